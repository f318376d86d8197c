// SPDX-License-Identifier: MIT
#include "detect/mpi/rank_cut.h"

#include <zoltan.h>

#include <cfloat>
#include <cmath>
#include <memory>

#include "padding/asset/error.h"

namespace padder::detect {
namespace {

using WeightedPoints = std::vector<WeightedPoint>;

const WeightedPoints& points_of(void* data) { return *static_cast<const WeightedPoints*>(data); }

int count_points(void* data, int* error) {
  *error = ZOLTAN_OK;
  return static_cast<int>(points_of(data).size());
}

void list_points(void* data, int, int, ZOLTAN_ID_PTR global, ZOLTAN_ID_PTR local, int, float* weights,
                 int* error) {
  const WeightedPoints& points = points_of(data);
  for (std::size_t k = 0; k < points.size(); k++) {
    global[k] = local[k] = static_cast<ZOLTAN_ID_TYPE>(k);  // a name is needed on its own rank only
    weights[k] = static_cast<float>(points[k].weight);
  }
  *error = ZOLTAN_OK;
}

int count_axes(void*, int* error) {
  *error = ZOLTAN_OK;
  return 3;
}

void list_coordinates(void* data, int, int, int count, ZOLTAN_ID_PTR, ZOLTAN_ID_PTR local, int, double* at,
                      int* error) {
  for (int k = 0; k < count; k++)
    for (int a = 0; a < 3; a++) at[3 * k + a] = points_of(data)[local[k]].at[a];
  *error = ZOLTAN_OK;
}

struct Destroy {
  void operator()(Zoltan_Struct* z) const { Zoltan_Destroy(&z); }
};

// Zoltan writes the largest double for a face at infinity.
double face(double at) { return std::abs(at) >= DBL_MAX ? std::copysign(INFINITY, at) : at; }

void zoltan_check(int code, const char* doing) {
  if (code != ZOLTAN_OK && code != ZOLTAN_WARN) throw Error(std::string("Zoltan cannot ") + doing);
}

std::vector<Region> regions_by_zoltan(MPI_Comm ranks, int count, const WeightedPoints& points) {
  float version = 0;
  zoltan_check(Zoltan_Initialize(0, nullptr, &version), "begin");
  const std::unique_ptr<Zoltan_Struct, Destroy> zoltan(Zoltan_Create(ranks));
  Zoltan_Struct* const z = zoltan.get();
  if (!z) throw Error("Zoltan cannot begin");
  const std::pair<const char*, const char*> settings[] = {
      {"DEBUG_LEVEL", "0"},           {"LB_METHOD", "RCB"},      {"KEEP_CUTS", "1"},
      {"RETURN_LISTS", "NONE"},       {"OBJ_WEIGHT_DIM", "1"},   {"NUM_GID_ENTRIES", "1"},
      {"NUM_LID_ENTRIES", "1"},       {"IMBALANCE_TOL", "1.02"}, {"RCB_OUTPUT_LEVEL", "0"},
      {"RCB_RECTILINEAR_BLOCKS", "1"}};
  for (const auto& [name, value] : settings) zoltan_check(Zoltan_Set_Param(z, name, value), "be set up");
  void* const data = const_cast<WeightedPoints*>(&points);
  Zoltan_Set_Num_Obj_Fn(z, count_points, data), Zoltan_Set_Obj_List_Fn(z, list_points, data);
  Zoltan_Set_Num_Geom_Fn(z, count_axes, data), Zoltan_Set_Geom_Multi_Fn(z, list_coordinates, data);
  int changes = 0, global = 0, local = 0, in = 0, out = 0;
  ZOLTAN_ID_PTR in_global = nullptr, in_local = nullptr, out_global = nullptr, out_local = nullptr;
  int *in_ranks = nullptr, *in_parts = nullptr, *out_ranks = nullptr, *out_parts = nullptr;
  zoltan_check(Zoltan_LB_Partition(z, &changes, &global, &local, &in, &in_global, &in_local, &in_ranks,
                                   &in_parts, &out, &out_global, &out_local, &out_ranks, &out_parts),
               "cut space");
  std::vector<Region> regions(static_cast<std::size_t>(count));
  for (int k = 0; k < count; k++) {
    Region& r = regions[static_cast<std::size_t>(k)];
    int axes = 0;
    zoltan_check(
        Zoltan_RCB_Box(z, k, &axes, &r.low[0], &r.low[1], &r.low[2], &r.high[0], &r.high[1], &r.high[2]),
        "tell a box");
    for (int a = 0; a < 3; a++) r.low[a] = face(r.low[a]), r.high[a] = face(r.high[a]);
  }
  return regions;
}

}  // namespace

BoxTree cut_among_ranks(MPI_Comm ranks, const WeightedPoints& points) {
  int count = 1;
  MPI_Comm_size(ranks, &count);
  const unsigned long long mine = points.size();
  unsigned long long all = 0;
  MPI_Allreduce(&mine, &all, 1, MPI_UNSIGNED_LONG_LONG, MPI_SUM, ranks);
  if (count == 1 || all == 0) return cut_space({}, static_cast<std::uint32_t>(count));
  std::vector<Region> regions = regions_by_zoltan(ranks, count, points);
  static_assert(sizeof(Region) == 6 * sizeof(double));
  MPI_Bcast(regions.data(), 6 * count, MPI_DOUBLE, 0, ranks);  // one tree for all, whatever the processors
  return tree_of(regions);
}

}  // namespace padder::detect
