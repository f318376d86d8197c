// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pad/manifest/run_parts.h"

#include <omp.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <set>
#include <unordered_set>

#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/input/read_internal.h"
#include "tools/arguments.h"
#include "tools/cli.h"
#include "tools/pad/manifest/part_list.h"
#include "tools/pad/manifest/parts_page.h"
#include "tools/pad/manifest/records.h"
#include "tools/pad/manifest/workers.h"
#include "tools/pad/one_part.h"
#include "tools/progress_bar.h"

namespace padder {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using cli::UsageError;

namespace {

// Of a part of which nothing is known yet.
Record record_for(const Part& part) {
  Record r;
  r.output = part.output, r.mesh = part.mesh;
  return r;
}

// What a worker does. The text is a Record as JSON; "disk" is added when the disk is at fault.
std::string pad_part(const Part& part, const fs::path& folder, int threads) {
  omp_set_num_threads(threads);
  Record r = record_for(part);
  bool disk = false;
  try {
    const PadArguments& a = part.settings->arguments;
    // The content before it is read: if it changes meanwhile, the next run notices.
    const std::string content = sha256_of_file(part.mesh);
    r.key = key_of(part, content);
    r.inputs.push_back({part.mesh, content});
    PadTarget target;
    target.robot = robot_of(part.mesh, a);
    for (const fs::path& file : further_inputs(part.mesh, target.robot))
      r.inputs.push_back({file.string(), sha256_of_file(file)});
    PadArguments named = a;
    named.outputs = {(folder / part.output).string()};
    target.outputs = {{named.output(), format_of(named, part.mesh)}};
    const Json report = pad_one(named, part.mesh, target, {}, [] {});
    r.sha256 = sha256_of_asset(part, folder);
    report.at("spheres").get_to(r.spheres), report.at("warnings").get_to(r.warnings);
    if (report.contains("diagonal")) {  // a mesh, not a robot
      const double diagonal = report["diagonal"];
      report["triangles_in"].get_to(r.triangles), report["within"].get_to(r.within);
      r.protrusion = report["accuracy"]["protrusion_max"].get<double>() / diagonal;
      r.gap = report["accuracy"]["gap_max"].get<double>() / diagonal;
      report["accuracy"]["certified"].get_to(r.certified);
    }
  } catch (const DiskError& e) {
    r.error = e.what(), disk = true;
  } catch (const Error& e) {
    r.error = e.what();
  }
  Json answer = to_json(r);
  if (disk) answer["disk"] = true;
  return answer.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// The parts of one call.
class Run {
 public:
  Run(const PadArguments& a, const std::map<std::string, std::string>& given)
      : a_(a), shard_(shard_of(a.shard)), folder_(a.output()), bar_("pad", !a.quiet) {
    check();
    for (Part& part : list_parts(a, given))
      if (shard_.holds(part)) parts_.push_back(std::move(part));
    for (const Part& part : parts_) state_.push_back({Fate::not_reached, record_for(part)});
    const int cores = omp_get_num_procs();
    const int most = static_cast<int>(std::clamp<std::size_t>(parts_.size(), 1, cli::kMostThreads));
    workers_ = std::min(most, a.workers > 0 ? a.workers : std::max(1, cores / std::max(1, a.threads)));
    threads_ = a.threads > 0 ? a.threads : std::max(1, cores / workers_);
    memory_ = machine_memory() / static_cast<unsigned>(workers_);
  }

  int run() {
    Records records(folder_, shard_);
    remove_partial_files();
    Workers workers;
    pad_all(records, workers);
    if (a_.page && workers.stopped() == 0) make_page(workers);
    bar_.clear();
    report(workers.stopped());
    return workers.stopped() > 0 ? 128 + workers.stopped() : done_ == parts_.size() ? 0 : 1;
  }

 private:
  // What is known of a part.
  enum class Fate : std::uint8_t { not_reached, current, made, failed };
  struct State {
    Fate fate = Fate::not_reached;
    Record record;
  };

  void check() const {
    if (a_.outputs.size() != 1 || (fs::exists(folder_) && !fs::is_directory(folder_)))
      throw UsageError("several parts need a folder: give -o FOLDER");
    if (!a_.preview.empty() || !a_.write_mesh.empty())
      throw UsageError("--preview and --write-mesh are for one mesh; a list of parts has --page");
    if (a_.page && !a_.shard.empty())
      throw UsageError(
          "--page shows all parts: when the shards are done, run once more with it and without --shard");
  }

  // What a run that was killed has left half-written. No other process writes these, because the shard is
  // locked.
  void remove_partial_files() const {
    std::unordered_set<std::string> outputs;
    std::set<fs::path> folders;
    for (const Part& part : parts_) {
      outputs.insert((folder_ / part.output).string());
      folders.insert((folder_ / part.output).parent_path());
    }
    for (const fs::path& folder : folders)
      remove_in(folder, [&](const std::string& file, const std::string&) { return outputs.contains(file); });
  }

  // What a worker that was ended has left.
  void remove_partial_files_of(const WorkerResult& result) const {
    const std::string process = std::to_string(result.process);
    remove_in((folder_ / parts_[result.job].output).parent_path(),
              [&](const std::string&, const std::string& of) { return of == process; });
  }

  template <class Wanted>
  static void remove_in(const fs::path& folder, const Wanted& wanted) {
    std::error_code code;
    for (const auto& entry : fs::directory_iterator(folder, code)) {
      const std::string name = entry.path().string();
      const std::size_t at = name.rfind(".part");
      if (at == std::string::npos || at + 5 == name.size() ||
          name.find_first_not_of("0123456789", at + 5) != std::string::npos)
        continue;
      if (wanted(name.substr(0, at), name.substr(at + 5))) fs::remove(entry.path(), code);
    }
  }

  WorkerLimits limits_of(const Part& part) const {
    const PadArguments& a = part.settings->arguments;
    return {a.seconds, a.memory.empty() ? memory_ : cli::bytes_of(a.memory).value_or(memory_)};
  }

  void pad_all(Records& records, Workers& workers) {
    std::size_t next = 0;
    for (;;) {
      while (next < parts_.size() && workers.running() < static_cast<std::size_t>(workers_) &&
             trouble_.empty()) {
        const std::size_t k = next++;
        const auto& known = records.of(parts_[k].output);
        const auto it = std::find_if(known.rbegin(), known.rend(),
                                     [&](const Record& r) { return is_current(r, parts_[k], folder_); });
        if (it != known.rend()) {
          set(k, Fate::current, *it);
          continue;
        }
        workers.start(k, limits_of(parts_[k]), [&, k] {
          records.close_in_child();
          return pad_part(parts_[k], folder_, threads_);
        });
      }
      const auto result = workers.wait();
      if (!result) break;
      take(*result, records);
    }
    for (const WorkerResult& result : workers.end_all()) {  // after a signal
      remove_partial_files_of(result);
      if (result.answered) take(result, records);
    }
  }

  void set(std::size_t k, Fate fate, const Record& record) {
    state_[k] = {fate, record};
    // A record may be of a mesh that lay elsewhere, and JSON holds no name that is not UTF-8.
    state_[k].record.output = parts_[k].output, state_[k].record.mesh = parts_[k].mesh;
    if (fate == Fate::failed) {
      failed_++;
      bar_.clear();
      std::fprintf(stderr, "pad: %s\n", excerpt(record.error, 4000).c_str());
    } else {
      done_++, made_ += fate == Fate::made, spheres_ += record.spheres;
    }
    if (const std::size_t at = done_ + failed_; at % 64 == 0 || fate != Fate::current)
      bar_.show(double(at) / double(parts_.size()), std::to_string(at) + " of " +
                                                        counted(parts_.size(), "part") + ", " +
                                                        std::to_string(failed_) + " failed");
  }

  void take(const WorkerResult& result, Records& records) {
    const Part& part = parts_[result.job];
    Record r = record_for(part);
    bool disk = false;
    if (result.answered) {
      const Json answer = Json::parse(result.answer);
      r = record_of(answer), disk = answer.contains("disk");
      r.output = part.output, r.mesh = part.mesh;  // JSON holds no name that is not UTF-8
    } else {
      remove_partial_files_of(result);
      r.error = part.mesh + ": " + result.answer;
    }
    r.seconds = result.seconds, r.cpu_seconds = result.cpu_seconds, r.memory = result.memory;
    set(result.job, r.done() ? Fate::made : Fate::failed, r);
    if (disk) trouble_ = "the parts that are left would fail as well";
    try {
      records.add(r);
    } catch (const Error& e) {
      trouble_ = e.what();
    }
  }

  void make_page(Workers& workers) {
    std::vector<PageRow> rows;
    for (const State& s : state_) rows.push_back({s.record, s.fate != Fate::not_reached});
    write_parts_page(rows, folder_, workers, static_cast<std::size_t>(workers_),
                     [&](double done) { bar_.show(done, "pictures for the page"); });
  }

  void report(int stopped) const {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count();
    const std::size_t left = parts_.size() - done_ - failed_;
    std::string end = trouble_;
    if (stopped > 0) end = std::string("ended by signal ") + std::to_string(stopped);
    if (!end.empty())
      std::fprintf(stderr, "pad: stopped with %zu of %s left: %s; the same command goes on from here\n", left,
                   counted(parts_.size(), "part").c_str(), excerpt(end, 4000).c_str());
    if (!a_.json && !a_.quiet) {
      std::printf("%s: %zu made, %zu were up to date, %zu failed", counted(parts_.size(), "part").c_str(),
                  made_, done_ - made_, failed_);
      if (left > 0) std::printf(", %zu not reached", left);
      std::printf("; %s; %.1f s with %s\n", counted(spheres_, "sphere").c_str(), seconds,
                  counted(static_cast<unsigned>(workers_), "worker").c_str());
    }
    if (!a_.json) return;
    Json all = Json::array();
    const char* names[] = {"not reached", "up to date", "made", "failed"};
    for (const State& s : state_) {
      Json j = {{"state", names[static_cast<int>(s.fate)]}};
      j.update(to_json(s.record));
      all.push_back(j);
    }
    const Json document = {{"parts", parts_.size()},
                           {"made", made_},
                           {"up_to_date", done_ - made_},
                           {"failed", failed_},
                           {"not_reached", left},
                           {"spheres", spheres_},
                           {"shard", a_.shard.empty() ? Json(nullptr) : Json(a_.shard)},
                           {"workers", workers_},
                           {"threads", threads_},
                           {"seconds", seconds},
                           {"stopped", end.empty() ? Json(nullptr) : Json(end)},
                           {"records", all}};
    cli::print_json(document);
  }

  const PadArguments& a_;
  Shard shard_;
  fs::path folder_;
  ProgressBar bar_;
  std::vector<Part> parts_;
  std::vector<State> state_;
  int workers_ = 1, threads_ = 1;
  std::uint64_t memory_ = 0, spheres_ = 0;
  std::size_t done_ = 0, made_ = 0, failed_ = 0;
  std::string trouble_;  // why no further part is begun
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

}  // namespace

int run_parts(const PadArguments& a, const std::map<std::string, std::string>& given) {
  return Run(a, given).run();
}

}  // namespace padder
