// What every tool's main does around its work: parse, run, and turn whatever goes wrong into one sentence on
// stderr and the exit code the command line promises (0 done, 1 the work failed, 2 wrong usage).
#pragma once
#include <CLI/CLI.hpp>
#include <cstdio>
#include <functional>
#include <new>
#include <stdexcept>

#include "padding/error.h"

namespace padder::cli {

// Arguments that parse, but make no sense together.
struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// The app must have its name. `work` gives the exit code.
inline int run(CLI::App& app, int argc, char** argv, const std::function<int()>& work) {
  const char* name = app.get_name().c_str();
  const auto fail = [&](int code, const std::string& sentence) {
    std::fprintf(stderr, "%s: %s\n", name, sentence.c_str());
    return code;
  };
  try {
    app.parse(argc, argv);
    return work();
  } catch (const CLI::Success& e) {  // --help, --version
    return app.exit(e);
  } catch (const CLI::ParseError& e) {  // CLI11's own exit codes are above 100
    return fail(2, e.what() + (" (see " + app.get_name()) + " --help)");
  } catch (const UsageError& e) {
    return fail(2, e.what());
  } catch (const Error& e) {
    return fail(1, e.what());
  } catch (const std::bad_alloc&) {
    return fail(1, "not enough memory: ask for less (a longer edge, a wider tolerance, fewer spheres)");
  } catch (const std::exception& e) {
    return fail(1, std::string("unexpected: ") + e.what());
  }
}

}  // namespace padder::cli
