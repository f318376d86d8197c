#include "padding/file.h"

#include <unistd.h>

#include <fstream>
#include <system_error>

#include "padding/error.h"

namespace padder {

std::string read_file(const std::filesystem::path& path) {
  std::error_code code;
  if (std::filesystem::is_directory(path, code)) throw Error(path.string() + " is a folder: name a file");
  std::ifstream in(path, std::ios::binary);
  if (!in) throw Error("cannot open " + path.string() + ": check the name and that it may be read");
  std::string bytes((std::istreambuf_iterator<char>(in)), {});
  if (in.bad()) throw Error("cannot read " + path.string() + " to its end");
  return bytes;
}

void write_file(const std::filesystem::path& path, std::string_view bytes) {
  // The process id keeps two runs that write the same asset at once out of each other's half-written file.
  std::filesystem::path beside = path;
  beside += ".part" + std::to_string(::getpid());
  std::error_code code;
  {
    std::ofstream out(beside, std::ios::binary | std::ios::trunc);
    if (out) out.write(bytes.data(), static_cast<std::streamsize>(bytes.size())).flush();
    if (!out) {
      out.close();
      std::filesystem::remove(beside, code);
      throw Error("cannot write " + path.string() +
                  ": check that the folder exists, may be written and has room");
    }
  }
  std::filesystem::rename(beside, path, code);
  if (code) {
    const std::string why = code.message();
    std::filesystem::remove(beside, code);
    throw Error("cannot write " + path.string() + ": " + why);
  }
}

}  // namespace padder
