// SPDX-License-Identifier: MIT
#include "padding/view/picture.h"

#include <embree3/rtcore.h>
#include <png.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/view/camera.h"
#include "padding/view/legend.h"

namespace padder {
namespace {

using Vec = Eigen::Vector3f;
constexpr float kNear = 1e-4f;  // how far from a surface a ray that leaves it begins; the diagonal is 1
constexpr float kDot = 5e-4f;   // the smallest radius that is drawn, so that a point can be seen
constexpr unsigned kMesh = 0, kSpheres = 1;
constexpr int kAlike = 8;  // samples of a pixel that all have one colour, as on the bare ground, are enough

float linear_of(std::uint8_t byte) {
  const float x = float(byte) / 255;
  return x <= 0.04045f ? x / 12.92f : std::pow((x + 0.055f) / 1.055f, 2.4f);
}
Vec linear_of(const Colour& c) { return {linear_of(c[0]), linear_of(c[1]), linear_of(c[2])}; }
std::uint8_t byte_of(float x) {
  x = std::clamp(x, 0.f, 1.f);
  const float y = x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1 / 2.4f) - 0.055f;
  return std::uint8_t(std::lround(255 * y));
}

// Numbers in 0 to 1 that fill a cube of 6 dimensions evenly (M. Roberts, The unreasonable effectiveness of
// quasirandom sequences, 2018: powers of the root of x^7 = x + 1), shifted by another amount in each pixel.
class Sampler {
 public:
  Sampler(std::uint32_t x, std::uint32_t y) : state_(x * 0x9E3779B1u ^ (y + 0x7F4A7C15u) * 0x85EBCA77u) {
    for (float& s : shift_) s = float(next() >> 8) * 0x1p-24f;
  }
  float operator()(int sample, int dimension) const {
    static const auto steps = [] {
      std::array<double, 6> a;
      double root = 1.1;
      for (int k = 0; k < 60; k++) root = std::pow(1 + root, 1.0 / 7);
      for (int k = 0; k < 6; k++) a[k] = std::pow(1 / root, k + 1);
      return a;
    }();
    const double x = shift_[dimension] + steps[dimension] * sample;
    return float(x - std::floor(x));
  }

 private:
  std::uint32_t next() {  // xorshift-multiply (PCG's output function)
    state_ = state_ * 747796405u + 2891336453u;
    const std::uint32_t w = ((state_ >> ((state_ >> 28) + 4)) ^ state_) * 277803737u;
    return (w >> 22) ^ w;
  }
  std::uint32_t state_;
  float shift_[6];
};

void tangents(const Vec& n, Vec& u, Vec& v) {
  u = (std::abs(n.x()) > 0.7f ? Vec(0, 1, 0) : Vec(1, 0, 0)).cross(n).normalized();
  v = n.cross(u);
}

struct Device {
  RTCDevice handle;
  // One thread, because it builds the same tree every time. Rendering uses all threads.
  Device() : handle(rtcNewDevice("threads=1")) {
    if (!handle) throw Error("Embree cannot start on this machine: it needs a processor with SSE2");
  }
  ~Device() { rtcReleaseDevice(handle); }
};

// One scene of Embree. Coordinates are those of Stage: centred, diagonal 1, z up.
class World {
 public:
  World(const Device& device, bool with_mesh, bool with_spheres, const std::vector<Vec>& points,
        const std::vector<std::array<std::uint32_t, 3>>& triangles, const std::vector<Vec>& centers,
        const std::vector<float>& radii)
      : scene_(rtcNewScene(device.handle)) {
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
    if (with_mesh && !triangles.empty()) {
      RTCGeometry g = rtcNewGeometry(device.handle, RTC_GEOMETRY_TYPE_TRIANGLE);
      void* at = buffer(g, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, 12, points.size());
      for (std::size_t k = 0; k < points.size(); k++)
        std::copy_n(points[k].data(), 3, static_cast<float*>(at) + 3 * k);
      at = buffer(g, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, 12, triangles.size());
      for (std::size_t k = 0; k < triangles.size(); k++)
        std::copy_n(triangles[k].data(), 3, static_cast<std::uint32_t*>(at) + 3 * k);
      attach(g, kMesh);
    }
    if (with_spheres && !radii.empty()) {
      RTCGeometry g = rtcNewGeometry(device.handle, RTC_GEOMETRY_TYPE_SPHERE_POINT);
      auto* at = static_cast<float*>(buffer(g, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT4, 16, radii.size()));
      for (std::size_t k = 0; k < radii.size(); k++)
        std::copy_n(centers[k].data(), 3, at + 4 * k), at[4 * k + 3] = radii[k];
      attach(g, kSpheres);
    }
    rtcCommitScene(scene_);
  }
  World(const World&) = delete;
  World& operator=(const World&) = delete;
  ~World() { rtcReleaseScene(scene_); }

  RTCRayHit first(const Vec& from, const Vec& along) const {
    RTCRayHit h{};
    h.ray = ray(from, along);
    h.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene_, &context, &h);
    return h;
  }
  bool blocked(const Vec& from, const Vec& along) const {
    RTCRay r = ray(from, along);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(scene_, &context, &r);
    return r.tfar < 0;
  }

 private:
  static RTCRay ray(const Vec& o, const Vec& d) {
    RTCRay r{};
    r.org_x = o.x(), r.org_y = o.y(), r.org_z = o.z();
    r.dir_x = d.x(), r.dir_y = d.y(), r.dir_z = d.z();
    r.tnear = 0, r.tfar = std::numeric_limits<float>::infinity(), r.mask = ~0u;
    return r;
  }
  static void* buffer(RTCGeometry g, RTCBufferType type, RTCFormat format, std::size_t stride,
                      std::size_t count) {
    void* at = rtcSetNewGeometryBuffer(g, type, 0, format, stride, count);
    if (!at) throw std::bad_alloc();
    return at;
  }
  void attach(RTCGeometry g, unsigned id) {
    rtcCommitGeometry(g);
    rtcAttachGeometryByID(scene_, g, id);
    rtcReleaseGeometry(g);
  }
  RTCScene scene_;
};

class Stage {
 public:
  Stage(const View& view, const PictureOptions& o) : view_(view), options_(o) {
    const Placement place(view, o.up);
    errors_ = mesh_errors(view, o.colour);
    if (const auto range = range_of(view, o.colour))
      for (float& e : errors_) e = float(range->share(e));
    // Coloured by an error, the mesh is drawn in the finer triangles of the error map.
    const Mesh& mesh = errors_.empty() ? view.mesh : view.errors.mesh;
    for (const Point& p : mesh.points) points_.push_back(place(p));
    triangles_ = mesh.triangles;
    own_ = triangles_.size();
    if (view.has_mesh() && errors_.empty())  // what repair did would hide the errors
      for (const Mark& mark : view.marks) add(mark, place);
    for (const Point& p : view.centers) centers_.push_back(place(p));
    for (const double r : view.radii) radii_.push_back(std::max(kDot, float(r / place.scale)));
    for (const Colour& c : colours_of(view, o.colour)) colours_.push_back(linear_of(c));
    ground_ = std::numeric_limits<float>::infinity();
    for (const Vec& p : points_) ground_ = std::min(ground_, p.z());
    for (std::size_t k = 0; k < radii_.size(); k++) ground_ = std::min(ground_, centers_[k].z() - radii_[k]);
    ground_ -= 1e-3f;
    mesh_colour_ = linear_of(palette().mesh);
    background_ = linear_of(o.dark ? palette().dark_background : palette().background);
    const Vec lamp(-0.6f, -0.45f, 0.8f);  // over the left shoulder of a camera that looks along +y
    const float turn = float((o.azimuth + 90) * std::numbers::pi / 180);
    lamp_ = Vec(lamp.x() * std::cos(turn) - lamp.y() * std::sin(turn),
                lamp.x() * std::sin(turn) + lamp.y() * std::cos(turn), lamp.z())
                .normalized();
  }

  // Behind the mesh's own triangles. A mark that lies on the mesh is moved towards the camera, to be seen.
  void add(const Mark& mark, const Placement& place) {
    const auto first = static_cast<std::uint32_t>(points_.size());
    const Vec nearer = -3e-4f * fitted(2, 2).forward;
    for (const Point& p : mark.mesh.points) points_.push_back(place(p) + nearer);
    for (const auto& t : mark.mesh.triangles) {
      triangles_.push_back({t[0] + first, t[1] + first, t[2] + first});
      mark_colours_.push_back(linear_of(palette().marks[std::size_t(mark.kind)]));
    }
  }

  // One panel of the picture, `left` pixels from its left side.
  Panel draw(Show show, int left, int width, Picture& picture) const {
    const Device device;
    const bool mesh = show == Show::mesh || show == Show::both, spheres = show != Show::mesh;
    const World world(device, mesh, spheres, points_, triangles_, centers_, radii_);
    std::vector<Vec> corners(points_.begin(), points_.begin() + std::ptrdiff_t(view_.mesh.points.size()));
    const World wires(device, show != Show::spheres, false, corners, view_.mesh.triangles, {}, {});
    const Camera camera = fitted(width, picture.height);
#pragma omp parallel for schedule(dynamic, 4)
    for (int y = 0; y < picture.height; y++)
      for (int x = 0; x < width; x++) {
        const Sampler sampler{std::uint32_t(x), std::uint32_t(y)};
        Vec sum = Vec::Zero(), first = sum;
        int s = 0;
        for (bool alike = true; s < options_.samples && !(alike && s == kAlike); s++) {
          const float px = float(x) + sampler(s, 0), py = float(y) + sampler(s, 1);
          const Vec along = camera.toward(2 * px / float(width) - 1, 1 - 2 * py / float(picture.height));
          float seen = 0;
          Vec colour = light_from(world, camera.eye, along, sampler, s, seen);
          if ((show == Show::wire || show == Show::mesh) && seen < INFINITY) {
            const float ink = wire_at(wires, camera, along, px, py, width, picture.height, seen);
            colour *= 1 - ink;
          }
          colour = colour.cwiseMin(1);  // otherwise a highlight would make the edges beside it jagged
          if (s == 0) first = colour;
          alike = alike && colour == first;
          sum += colour;
        }
        std::uint8_t* out = picture.rgb.data() + 3 * (std::size_t(y) * picture.width + left + x);
        for (int k = 0; k < 3; k++) out[k] = byte_of(sum[k] / float(s));
      }
    return {left, width, camera, spheres};
  }

 private:
  Camera fitted(int width, int height) const {
    Camera c;
    const float az = float(options_.azimuth * std::numbers::pi / 180),
                el = float(options_.elevation * std::numbers::pi / 180);
    c.forward = -Vec(std::cos(el) * std::cos(az), std::cos(el) * std::sin(az), std::sin(el));
    c.right = Vec(-std::sin(az), std::cos(az), 0);
    c.up = c.right.cross(c.forward);
    constexpr float margin = 1.12f, angle = 0.22f;  // tangent of half the angle of view of the shorter side
    const float shorter = float(std::min(width, height));
    c.tan_x = angle * float(width) / shorter, c.tan_y = angle * float(height) / shorter;
    // Finds the eye from which every point is inside the frame. For each of the frame's four sides the point
    // that is farthest out decides. The left and the right side give the eye's horizontal place and one
    // distance; the upper and the lower side give its vertical place and another distance.
    float most[4] = {-1e30f, -1e30f, -1e30f, -1e30f};
    const float tx = c.tan_x / margin, ty = c.tan_y / margin;
    // The lower side ends above the legend.
    const float below = ty * (1 - 2 * float(legend_height(options_)) / float(options_.height));
    const auto reach = [&](const Vec& p, float r) {
      const float x = p.dot(c.right), y = p.dot(c.up), z = p.dot(c.forward);
      const float rx = r * std::sqrt(1 + tx * tx), ry = r * std::sqrt(1 + ty * ty);
      const float rb = r * std::sqrt(1 + below * below);
      most[0] = std::max(most[0], x - tx * z + rx), most[1] = std::max(most[1], -x - tx * z + rx);
      most[2] = std::max(most[2], y - ty * z + ry), most[3] = std::max(most[3], -y - below * z + rb);
    };
    for (const Vec& p : points_) reach(p, 0);
    for (std::size_t k = 0; k < radii_.size(); k++) reach(centers_[k], radii_[k]);
    const float back = std::max((most[0] + most[1]) / (2 * tx), (most[2] + most[3]) / (ty + below));
    c.eye = c.right * ((most[0] - most[1]) / 2) + c.up * ((most[2] - most[3] - (ty - below) * back) / 2) -
            c.forward * back;
    return c;
  }

  // Of the sky, or of the ground where the direction points down.
  static float sky(const Vec& d) { return d.z() >= 0 ? 0.75f + 0.35f * d.z() : 0.42f; }

  Vec light_from(const World& world, const Vec& eye, const Vec& along, const Sampler& sampler, int s,
                 float& seen) const {
    const RTCRayHit h = world.first(eye, along);
    Vec n, at, albedo;
    float gloss = 0;
    if (h.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
      seen = std::numeric_limits<float>::infinity();
      const float t = (ground_ - eye.z()) / along.z();
      if (!(along.z() < 0 && t > 0)) return background_;
      at = eye + along * t, n = Vec(0, 0, 1);
      return background_ * ground_share(world, at + n * kNear, sampler, s);
    }
    seen = h.ray.tfar;
    at = eye + along * h.ray.tfar;
    if (h.hit.geomID == kSpheres) {
      n = at - centers_[h.hit.primID];
      at = centers_[h.hit.primID] + n * (radii_[h.hit.primID] / n.norm());
      albedo = colours_[h.hit.primID];
      gloss = 0.10f;
    } else {
      n = Vec(h.hit.Ng_x, h.hit.Ng_y, h.hit.Ng_z);
      albedo = h.hit.primID >= own_ ? mark_colours_[h.hit.primID - own_]
               : errors_.empty()    ? mesh_colour_
                                    : error_colour(h.hit);
      gloss = 0.04f;
    }
    if (!(n.squaredNorm() > 0)) n = -along;  // a triangle without area
    n.normalize();
    if (n.dot(along) > 0) n = -n;
    const Vec from = at + n * kNear;
    const Vec d = diffuse(n, sampler(s, 2), sampler(s, 3));
    float light = 0.62f * (world.blocked(from, d) ? 0.16f : sky(d));
    const Vec l = broad_lamp(sampler(s, 4), sampler(s, 5));
    float highlight = 0;
    if (n.dot(l) > 0 && !world.blocked(from, l)) {
      light += 0.62f * n.dot(l);
      highlight = gloss * std::pow(std::max(0.f, n.dot((l - along).normalized())), 40.f);
    }
    return albedo * light + Vec::Constant(highlight);
  }

  // Between the errors at the triangle's corners.
  Vec error_colour(const RTCHit& h) const {
    const auto& t = triangles_[h.primID];
    return linear_of(along_ramp((1 - h.u - h.v) * errors_[t[0]] + h.u * errors_[t[1]] + h.v * errors_[t[2]]));
  }

  // The fraction of its light that the ground receives: 1 where nothing stands in the way.
  float ground_share(const World& world, const Vec& from, const Sampler& sampler, int s) const {
    const float sky_share =
        world.blocked(from, diffuse(Vec(0, 0, 1), sampler(s, 2), sampler(s, 3))) ? 0.f : 0.55f;
    return sky_share + (world.blocked(from, broad_lamp(sampler(s, 4), sampler(s, 5))) ? 0.15f : 0.45f);
  }

  static Vec diffuse(const Vec& n, float a, float b) {  // cosine-weighted around n
    Vec u, v;
    tangents(n, u, v);
    const float r = std::sqrt(a), turn = 2 * std::numbers::pi_v<float> * b;
    return (u * (r * std::cos(turn)) + v * (r * std::sin(turn)) + n * std::sqrt(std::max(1e-6f, 1 - a)))
        .normalized();
  }
  Vec broad_lamp(float a, float b) const {  // a disc of 12 degrees across
    Vec u, v;
    tangents(lamp_, u, v);
    const float r = 0.105f * std::sqrt(a), turn = 2 * std::numbers::pi_v<float> * b;
    return (lamp_ + u * (r * std::cos(turn)) + v * (r * std::sin(turn))).normalized();
  }

  // How strongly the nearest edge of the mesh is drawn here, 0 to 1. An edge a little behind the sphere in
  // front is drawn too, because spheres stand out of the mesh. Edges of triangles that are only a few pixels
  // large fade, or they would blacken the picture.
  float wire_at(const World& wires, const Camera& camera, const Vec& along, float px, float py, int width,
                int height, float seen) const {
    const RTCRayHit h = wires.first(camera.eye, along);
    if (h.hit.geomID == RTC_INVALID_GEOMETRY_ID || h.ray.tfar > seen + 0.02f) return 0;
    const auto& t = view_.mesh.triangles[h.hit.primID];
    Eigen::Vector2f p[3];
    for (int k = 0; k < 3; k++) p[k] = camera.project(points_[t[k]], float(width), float(height));
    const auto cross = [](const Eigen::Vector2f& a, const Eigen::Vector2f& b) {
      return a.x() * b.y() - a.y() * b.x();
    };
    float nearest = 1e30f, longest = 0;
    const float area = std::abs(cross(p[1] - p[0], p[2] - p[0]));
    for (int k = 0; k < 3; k++) {
      const Eigen::Vector2f a = p[k], e = p[(k + 1) % 3] - a;
      nearest =
          std::min(nearest, std::abs(cross(e, Eigen::Vector2f(px, py) - a)) / std::max(e.norm(), 1e-6f));
      longest = std::max(longest, e.norm());
    }
    const float size = area / std::max(longest, 1e-6f), fade = std::clamp((size - 1.5f) / 8, 0.f, 1.f);
    return nearest < 0.55f * float(height) / 800 + 0.1f ? 0.25f + 0.4f * fade - 0.2f * (1 - fade) : 0;
  }

  const View& view_;
  const PictureOptions& options_;
  std::vector<Vec> points_, centers_, colours_, mark_colours_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;  // of the mesh, and behind them those of the marks
  std::size_t own_ = 0;                                  // those of the mesh
  std::vector<float> radii_, errors_;                    // errors: of the mesh's points, 0 to 1; or none
  float ground_ = 0;
  Vec mesh_colour_, background_, lamp_;
};

Picture render_level(const View& view, const PictureOptions& o) {
  Picture picture{o.width, o.height, std::vector<std::uint8_t>(std::size_t(3) * o.width * o.height)};
  const Stage stage(view, o);
  const Show show = view.has_mesh() ? o.show : Show::spheres;
  std::vector<Panel> panels;
  if (show == Show::side) {
    panels.push_back(stage.draw(Show::mesh, 0, o.width / 2, picture));
    panels.push_back(stage.draw(Show::spheres, o.width / 2, o.width - o.width / 2, picture));
  } else {
    panels.push_back(stage.draw(show, 0, o.width, picture));
  }
  draw_contacts(view, o, panels, picture);
  draw_legend(view, o, panels, picture);
  return picture;
}

}  // namespace

Picture render(const View& view, const PictureOptions& o) {
  if (o.width < 16 || o.height < 16 || o.width > 16384 || o.height > 16384)
    throw Error("a picture is 16 to 16384 pixels wide and high");
  if (o.samples < 1 || o.samples > 4096) throw Error("a picture takes 1 to 4096 samples a pixel");
  if (o.up != 'x' && o.up != 'y' && o.up != 'z') throw Error("the axis that points up is x, y or z");
  if (!std::isfinite(o.azimuth) || !(std::abs(o.elevation) <= 89))
    throw Error("the camera stands at an elevation of -89 to 89 degrees");
  if (view.size() == 0 && !view.has_mesh())
    throw Error(view.title + " holds no sphere, so there is nothing to show");
  if (!view.rungs.empty() || o.rung != 0) return render_level(one_rung(view, o.rung), o);
  return render_level(view, o);
}

std::string png_bytes(const Picture& picture) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = png_uint_32(picture.width), image.height = png_uint_32(picture.height);
  image.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = 0;
  std::string bytes;
  if (png_image_write_get_memory_size(image, size, 0, picture.rgb.data(), 0, nullptr)) {
    bytes.resize(size);
    if (png_image_write_to_memory(&image, bytes.data(), &size, 0, picture.rgb.data(), 0, nullptr)) {
      bytes.resize(size);
      return bytes;
    }
  }
  throw Error(std::string("the picture cannot be written as PNG: ") + image.message);
}

void write_png(const Picture& picture, const std::filesystem::path& path) {
  write_file(path, png_bytes(picture));
}

}  // namespace padder
