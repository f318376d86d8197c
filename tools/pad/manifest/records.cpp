// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pad/manifest/records.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/asset/json.h"
#include "padding/input/read_internal.h"

namespace padder {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

constexpr auto kReplace = Json::error_handler_t::replace;  // the name of a file need not be UTF-8

// The name of an output in a record. Were its bytes replaced, a later run would not find it.
std::string name_in_record(const std::string& output) try {
  (void)Json(output).dump();
  return output;
} catch (const Json::exception&) {
  return excerpt(output, output.size());
}

// Calls each(key, value) for all that a record holds.
template <class SomeRecord, class Each>
void each_value(SomeRecord& r, const Each& each) {
  each("output", r.output), each("mesh", r.mesh), each("key", r.key);
  each("inputs", r.inputs), each("sha256", r.sha256), each("error", r.error);
  each("triangles", r.triangles), each("spheres", r.spheres);
  each("protrusion", r.protrusion), each("gap", r.gap), each("certified", r.certified);
  each("within", r.within), each("warnings", r.warnings), each("seconds", r.seconds);
  each("cpu_seconds", r.cpu_seconds), each("memory", r.memory);
}

}  // namespace

static void to_json(Json& j, const Record::Input& input) {
  j = {{"file", input.file}, {"sha256", input.sha256}};
}
static void from_json(const Json& j, Record::Input& input) {
  j.at("file").get_to(input.file), j.at("sha256").get_to(input.sha256);
}

Record record_of(const Json& j) {
  Record r;
  each_value(r, [&](const char* key, auto& value) { j.at(key).get_to(value); });
  return r;
}

Json to_json(const Record& r) {
  Json j;
  each_value(r, [&](const char* key, const auto& value) { j[key] = value; });
  return j;
}

std::string key_of(const Part& part, const std::string& sha256_of_mesh) {
  const Json made_of = {{"version", PADDER_VERSION},
                        {"mesh", fs::path(part.mesh).filename().string()},
                        {"sha256", sha256_of_mesh},
                        {"settings", part.settings->given}};
  return sha256(made_of.dump(-1, ' ', false, kReplace));
}

std::string sha256_of_asset(const Part& part, const fs::path& folder) {
  const std::string output = sha256_of_file(folder / part.output);
  std::error_code code;  // spheres that are converted need not have pairs
  return part.pairs.empty() || !fs::exists(folder / part.pairs, code)
             ? output
             : sha256(output + sha256_of_file(folder / part.pairs));
}

bool is_current(const Record& record, const Part& part, const fs::path& folder) try {
  if (!record.done() || record.inputs.empty()) return false;
  for (const Record::Input& input : record.inputs) {
    const bool first = &input == record.inputs.data();
    const std::string now = sha256_of_file(first ? part.mesh : input.file);
    if (now != input.sha256 || (first && record.key != key_of(part, now))) return false;
  }
  return sha256_of_asset(part, folder) == record.sha256;
} catch (const Error&) {  // something is missing
  return false;
}

Records::Records(const fs::path& folder, const Shard& shard) {
  const fs::path place = folder / ".pad";
  path_ = place / (shard.name() + ".jsonl");
  std::error_code code;
  fs::create_directories(place, code);  // if this fails, opening fails and names the reason
  // A pipe under this name would keep open() waiting, and a link would lead to a file that is no record.
  file_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666);
  if (struct stat about{};
      file_ < 0 ? errno == ELOOP : ::fstat(file_, &about) == 0 && !S_ISREG(about.st_mode))
    throw Error(path_.string() + " is a link, a device or a pipe, and pad keeps its record there: remove it");
  if (file_ < 0)
    throw Error("cannot write " + path_.string() + " (" + std::strerror(errno) +
                "): -o must name a folder that may be written");
  if (::flock(file_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
    throw Error("another pad is at work on this portion of " + folder.string() +
                ": wait for it, or end it and start again");
  try {
    for (const auto& entry : fs::directory_iterator(place))
      if (entry.path().extension() == ".jsonl" && fs::is_regular_file(entry.symlink_status()))
        read(entry.path());
  } catch (const fs::filesystem_error& e) {
    throw Error("cannot read the folder " + place.string() + " (" + e.code().message() + ")");
  }
  // What a crash cut short gets its end, so that the next line stands by itself.
  char last = '\n';
  const off_t end = ::lseek(file_, 0, SEEK_END);
  if (end > 0 && ::pread(file_, &last, 1, end - 1) == 1 && last != '\n' && ::write(file_, "\n", 1) != 1)
    throw DiskError("cannot write " + path_.string() + " (" + std::strerror(errno) + "): make room");
}

Records::~Records() {
  if (file_ >= 0) ::close(file_);
}

void Records::read(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  for (std::string line; std::getline(in, line);) try {
      Record record = record_of(Json::parse(line));
      known_[record.output].push_back(std::move(record));
    } catch (const Json::exception&) {
    }
}

const std::vector<Record>& Records::of(const std::string& output) const {
  static const std::vector<Record> none;
  const auto it = known_.find(name_in_record(output));
  return it == known_.end() ? none : it->second;
}

void Records::add(const Record& record) {
  Record named = record;
  named.output = name_in_record(record.output);
  const std::string line = to_json(named).dump(-1, ' ', false, kReplace) + "\n";
  const ssize_t written = ::write(file_, line.data(), line.size());
  if (written != static_cast<ssize_t>(line.size()))
    throw DiskError("cannot write " + path_.string() + " (" + std::strerror(written < 0 ? errno : ENOSPC) +
                    "): make room and start again");
  known_[named.output].push_back(std::move(named));
}

void Records::close_in_child() {
  if (file_ >= 0) ::close(file_);
  file_ = -1;
}

}  // namespace padder
