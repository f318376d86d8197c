// SPDX-License-Identifier: GPL-3.0-or-later
// Compares two documents of one bench, time by time: is the new one slower than may be?
#include <algorithm>
#include <cstdio>

#include "padding/asset/error.h"
#include "tools/bench/bench.h"
#include "tools/bench/report/document.h"
#include "tools/cli.h"

namespace padder::bench {
namespace {

// Which fields of a bench's rows say what was measured, and which are its times in seconds.
struct Fields {
  const char* bench;
  std::vector<const char*> texts, flags, amounts;  // that name a row
  std::vector<const char*> times;
  const char* inside = nullptr;  // the times stand in an object of this name
};

const Fields& fields_of(const std::string& bench, const std::string& where) {
  const std::vector<const char*> calls = {"seconds_fast", "seconds_exact", "seconds_exact_fixed",
                                          "seconds_exact_points"};
  static const Fields all[] = {
      {"scaling", {"scene", "backend"}, {"random_order"}, {"spheres"}, calls},
      {"bodies", {"scene", "backend"}, {"random_order"}, {"spheres"}, calls},
      // A single stage takes a few microseconds and varies more than a change is worth: their sum counts.
      {"stages", {"backend", "path"}, {}, {"spheres"}, {"total"}, "seconds"},
      {"speedup", {"backend"}, {}, {"spheres"}, {"seconds", "seconds_pairs"}},
      {"frontier", {"mesh", "method"}, {}, {"setting_percent"}, {"seconds"}},
  };
  for (const Fields& f : all)
    if (bench == f.bench) return f;
  throw Error(where + ": " + bench + " measures no time; scaling, bodies, stages, speedup and frontier do");
}

struct Row {
  std::string name;
  std::string hash;  // of the contacts found; empty where the bench has none
  std::vector<double> seconds;
};

std::vector<Row> read_rows(const Json& document, const std::string& where, const Fields& fields) {
  std::vector<Row> rows;
  for (const Reader& r : rows_of(document, where)) {
    Row row;
    const auto add = [&](const std::string& word) { row.name += (row.name.empty() ? "" : " ") + word; };
    for (const char* key : fields.texts) add(r.text(key));
    for (const char* key : fields.flags)
      if (r.flag(key)) add(key == std::string("random_order") ? "random" : key);
    for (const char* key : fields.amounts) add(number(r.amount(key), "%.15g"));
    if (r.has("hash")) row.hash = r.text("hash");
    for (const char* key : fields.times) {
      const double seconds = fields.inside ? r.inner(fields.inside).amount(key) : r.amount(key);
      if (!(seconds > 0)) throw Error(r.where() + ": " + key + " is 0: there is nothing to compare with");
      row.seconds.push_back(seconds);
    }
    const auto same = [&](const Row& other) { return other.name == row.name; };
    if (std::any_of(rows.begin(), rows.end(), same))
      throw Error(r.where() + ": an earlier row is of " + row.name + ", too: which of them counts?");
    rows.push_back(std::move(row));
  }
  return rows;
}

const Row* find_row(const std::vector<Row>& rows, const std::string& name) {
  const auto it = std::find_if(rows.begin(), rows.end(), [&](const Row& r) { return r.name == name; });
  return it == rows.end() ? nullptr : &*it;
}

std::string milliseconds(double seconds) { return number(seconds * 1e3, "%.3f"); }

// What the two documents say of each row, and of each time in it.
class Comparison {
 public:
  explicit Comparison(double within) : within_(within) {}

  void add(const Row& before, const Row& after, const Fields& fields) {
    if (before.hash != after.hash) {
      differing_++;
      table.push_back({before.name, "", "", "", "", "OTHER CONTACTS"});
      rows.push_back({{"row", before.name}, {"hash_old", before.hash}, {"hash_new", after.hash}});
    }
    for (std::size_t k = 0; k < before.seconds.size(); k++) {
      const double ratio = after.seconds[k] / before.seconds[k];
      const bool slower = ratio > 1 + within_;
      slower_ += slower;
      worst_ = std::max(worst_, ratio);
      table.push_back({before.name, fields.times[k], milliseconds(before.seconds[k]),
                       milliseconds(after.seconds[k]), number(ratio, "%.3f"), slower ? "SLOWER" : ""});
      rows.push_back({{"row", before.name},
                      {"time", fields.times[k]},
                      {"seconds_old", before.seconds[k]},
                      {"seconds_new", after.seconds[k]},
                      {"ratio", ratio},
                      {"slower", slower}});
    }
    compared_++;
  }

  void add_missing(const std::string& name, const char* side) {
    table.push_back({name, "", "", "", "", std::string("missing in ") + side});
    missing.push_back({{"row", name}, {"missing_in", side}});
  }

  int compared() const { return compared_; }
  bool passed() const { return slower_ == 0 && differing_ == 0; }

  // Empty where the new document is as fast as it must be.
  std::string sentence() const {
    std::string out;
    if (slower_)
      out = counted(slower_, "time is", "times are") + " slower than the old by more than " +
            number(100 * within_, "%g") + " %, at worst " + number(worst_, "%.3f") + " times as long";
    if (differing_)
      out += (out.empty() ? "" : "; ") + counted(differing_, "row") + " found other contacts than the old";
    return out;
  }

  Json rows = Json::array(), missing = Json::array();
  Json table = Json::array({{"row", "time", "old [ms]", "new [ms]", "new / old", ""}});

 private:
  double within_;
  int compared_ = 0, slower_ = 0, differing_ = 0;
  double worst_ = 0;
};

// A ratio between two machines says nothing about the code: this is said, not refused.
void say_other_machine(const Settings& s, const Json& before, const Json& after) {
  for (const char* key : {"machine", "device"})
    if (before.value(key, Json()) != after.value(key, Json()))
      say(s, std::string("the two files name different values for \"") + key +
                 "\": " + before.value(key, Json()).dump() + " and " + after.value(key, Json()).dump());
}

}  // namespace

Json compare(const Settings& s) {
  if (s.files.size() != 2)
    throw cli::UsageError("name two files that the same bench wrote: bench compare OLD.json NEW.json");
  const std::string &old_file = s.files[0], &new_file = s.files[1];
  const Json before = read_document(old_file), after = read_document(new_file);
  const std::string bench = bench_of(before, old_file), other = bench_of(after, new_file);
  if (bench != other)
    throw Error(new_file + " is of the bench " + other + ", and " + old_file + " of " + bench +
                ": compare files of the same bench");
  const Fields& fields = fields_of(bench, old_file);
  const std::vector<Row> old_rows = read_rows(before, old_file, fields),
                         new_rows = read_rows(after, new_file, fields);
  Comparison result(s.within);
  for (const Row& row : old_rows)
    if (const Row* match = find_row(new_rows, row.name))
      result.add(row, *match, fields);
    else
      result.add_missing(row.name, "NEW");
  for (const Row& row : new_rows)
    if (!find_row(old_rows, row.name)) result.add_missing(row.name, "OLD");
  if (result.compared() == 0)
    throw Error(old_file + " and " + new_file + " have no row in common: were they run with other options?");
  say_other_machine(s, before, after);
  if (!result.passed()) std::fprintf(stderr, "bench: %s\n", result.sentence().c_str());
  return {{"bench", "compare"},        {"within", s.within},  {"passed", result.passed()},
          {"missing", result.missing}, {"rows", result.rows}, {"table", result.table}};
}

}  // namespace padder::bench
