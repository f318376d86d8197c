// SPDX-License-Identifier: GPL-3.0-or-later
// What every tool's main does around its work: it parses the arguments, runs the work, and turns every
// failure into one sentence on stderr and an exit code (0 done, 1 the work failed, 2 wrong usage).
#pragma once
#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <iostream>
#include <iterator>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "tools/usage.h"

namespace padder::cli {

// Thrown for arguments that CLI11 accepts but that contradict each other.
struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Throws UsageError, the option and `why`, if one of these options was given.
inline void refuse_options(const CLI::App& app, std::initializer_list<const char*> options,
                           const std::string& why) {
  for (const char* option : options)
    if (app.count(option) > 0) throw UsageError(option + why);
}

// Throws UsageError where an option was given an empty text, as by a script whose variable is not set: to
// take it for an option that was left out would lose what the work was done for.
inline void refuse_empty(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options())
    for (const std::string& text : option->results())
      if (text.empty())
        throw UsageError(
            option->get_name() + " is empty: " +
            (option->get_positional() ? "name a file" : "say what it is to be, or leave it out"));
  for (const CLI::App* sub : app.get_subcommands()) refuse_empty(*sub);
}

// The largest --threads. No machine has more; a hundred thousand stacks would end the program without a
// message.
inline constexpr int kMostThreads = 1024;

// Formats --help as docs/cli.md shows it: names on the left, sentences on the right, lines of at most 100
// columns.
class Formatter : public CLI::Formatter {
 public:
  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    // CLI11's type is as "FLOAT:FLOAT in [1 - 180]": what the option takes, then how it is checked. Of the
    // check only a range is shown, and only if the description does not state it.
    const std::string type = option->get_type_name();
    std::string taken = type.substr(0, type.find(':'));
    if (taken == "INT" || taken == "UINT") taken = "N";
    if (taken == "FLOAT") taken = "X";
    std::string left = "  " + make_option_name(option, is_positional);
    if (!is_positional && option->get_type_size() != 0 && !taken.empty()) left += " " + taken;
    if (option->get_expected_max() == CLI::detail::expected_max_vector_size)
      left += is_positional ? "..." : "";
    std::string right = option->get_description();
    std::smatch range;
    const bool told = right.find(" to ") != std::string::npos || right.find("at most") != std::string::npos;
    if (!told && std::regex_search(type, range, std::regex(R"(in \[(\S+) - (\S+)\])")))
      right += "; " + range[1].str() + " to " + range[2].str();
    if (!option->get_default_str().empty()) right += " (default: " + option->get_default_str() + ")";
    if (option->get_required()) right += " (required)";
    return two_columns(left, right);
  }
  std::string make_subcommand(const CLI::App* sub) const override {
    return two_columns("  " + sub->get_name(), sub->get_description());
  }

 private:
  static std::string two_columns(std::string line, const std::string& right) {
    constexpr std::size_t column = 25, width = 100;
    std::string out;
    if (line.size() + 2 > column) out = line + "\n", line.clear();
    line.resize(column, ' ');
    std::istringstream words(right);
    for (std::string word; words >> word;) {
      if (line.size() > column && line.size() + 1 + word.size() > width)
        out += line + "\n", line.assign(column, ' ');
      line += (line.size() > column ? " " : "") + word;
    }
    line.erase(line.find_last_not_of(' ') + 1);
    return out + line + "\n";
  }
};

inline void set_help(CLI::App& app) {
  app.formatter(std::make_shared<Formatter>());
  app.get_help_ptr()->description("print this and exit");
  if (app.get_version_ptr()) app.get_version_ptr()->description("print the version and exit");
  for (CLI::App* sub : app.get_subcommands([](CLI::App*) { return true; })) set_help(*sub);
  if (!app.get_parent())
    app.footer("Results go to stdout, talk to stderr. Exit code: 0 done, 1 the work failed, 2 wrong usage.");
}

// With --json: the document as text. Bytes that are no UTF-8, as the name of a file may have them, are
// replaced.
inline void print_json(const nlohmann::ordered_json& document) {
  std::cout << document.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << std::endl;
}

// When the work fails. The sentence goes to stderr as well.
inline void print_failure(const std::string& input, const std::string& error) {
  print_json({{"input", input}, {"error", error}});
}

// Throws Error when what was printed could not be written: a full disk must not look like success.
inline void flush_results() {
  std::cout.flush();
  if (std::fflush(stdout) == 0 && std::cout && !std::ferror(stdout)) return;
  throw Error("cannot write to the standard output (" + std::generic_category().message(errno) + ")");
}

// What else to remove when a signal ends the program; null: nothing.
inline void (*&when_ended())() {
  static void (*remove)() = nullptr;
  return remove;
}

// Before the program ends in the middle of its work. Calls only what a signal handler may call.
inline void remove_all_unfinished() {
  remove_unfinished_files();
  if (when_ended()) when_ended()();
}

// Ends the program as a shell expects of Ctrl-C: exit code 130, and 143 or 129 for the other two. A file that
// is being written is removed; one that stood under its name before is untouched.
inline void end_cleanly_on_signals() {
  for (const int number : {SIGINT, SIGTERM, SIGHUP})
    if (std::signal(number, [](int signal) {
          remove_all_unfinished();
          ::_exit(128 + signal);
        }) == SIG_IGN)
      std::signal(number, SIG_IGN);  // as nohup and a shell's background jobs want it
  // The reader of a pipe has ended, as head does. A shell wants to see the signal itself.
  if (std::signal(SIGPIPE, [](int signal) {
        remove_all_unfinished();
        std::signal(signal, SIG_DFL), std::raise(signal);
      }) == SIG_IGN)
    std::signal(SIGPIPE, SIG_IGN);
}

inline constexpr const char* kNoMemory =
    "not enough memory: ask for less (a longer edge, a wider tolerance, fewer spheres)";

// An exception that leaves a thread or a parallel region cannot be caught any more: as a rule memory ran out
// there. The program then ends with a sentence and not with a signal.
inline void end_with_a_sentence(const char* program) {
  static const char* name = nullptr;
  name = program;
  std::set_terminate([] {
    remove_all_unfinished();
    try {
      if (const std::exception_ptr left = std::current_exception()) std::rethrow_exception(left);
      std::fprintf(stderr, "%s: ended unexpectedly\n", name);
    } catch (const std::bad_alloc&) {
      std::fprintf(stderr, "%s: %s\n", name, kNoMemory);
    } catch (const std::exception& e) {
      std::fprintf(stderr, "%s: %s\n", name, e.what());
    } catch (...) {
    }
    ::_exit(1);
  });
}

// A program that was started with a closed standard stream would open its next file under that number, and
// what it prints would go into the file. What takes the stream's place fails with an error, as the closed
// one.
inline void hold_standard_streams() {
  int file = 0;
  while (file >= 0 && file <= STDERR_FILENO) {
    file = ::open("/dev/null", ::fcntl(STDIN_FILENO, F_GETFD) < 0 ? O_WRONLY : O_RDONLY);
    if (file > STDERR_FILENO) ::close(file);
  }
}

// About a name that the system refuses.
inline std::string what_to_do(const std::error_code& code) {
  if (code == std::errc::filename_too_long) return ": give it a shorter name";
  if (code == std::errc::too_many_symbolic_link_levels)
    return ": its links lead round in a circle: name the file itself";
  return ": check the name, and that it may be read and written";
}

// What scripts pass to any program with --colour.
inline constexpr const char* kWhenColoured[] = {"never", "auto", "always"};

// `app` must have a name. `work` returns the exit code. `failed` receives the sentence of a failure that
// happens after parsing: a tool with --json also prints it on stdout.
inline int run(CLI::App& app, int argc, char** argv, const std::function<int()>& work,
               const std::function<void(const std::string&)>& failed = {}) {
  hold_standard_streams();
  std::string colour;
  if (!app.get_option_no_throw("--colour"))
    app.add_option("--colour,--color", colour,
                   "never, auto or always, for scripts: no text is coloured, whatever it is")
        ->check(CLI::IsMember(std::set<std::string>(std::begin(kWhenColoured), std::end(kWhenColoured))))
        ->type_name("WHEN");
  set_help(app);
  const char* name = app.get_name().c_str();
  const auto fail = [&](int code, const std::string& sentence) {
    // One line of plain text, whatever names and arguments are in it.
    std::fprintf(stderr, "%s: %s\n", name, excerpt(sentence, 4000).c_str());
    return code;
  };
  try {
    refuse_short_with_equals(argc, argv);
    app.parse(argc, argv);
  } catch (const CLI::Success& e) {  // --help, --version
    const int code = app.exit(e);
    try {
      flush_results();
    } catch (const Error& full) {
      return fail(1, full.what());
    }
    return code;
  } catch (const CLI::ParseError& e) {  // CLI11's own exit codes are above 100
    const std::string sentence = usage_sentence(app, e);
    for (int k = 1; k < argc; k++)
      if (failed && argv[k] == std::string_view("--json")) print_failure("", sentence);
    return fail(2, sentence + " (see " + app.get_name() + " --help)");
  }
  const auto fail_told = [&](int code, const std::string& sentence) {
    if (failed) failed(sentence);
    return fail(code, sentence);
  };
  end_cleanly_on_signals(), end_with_a_sentence(name);
  std::signal(SIGXFSZ, SIG_IGN);  // then a write beyond the limit of file sizes fails with an error
  try {
    refuse_empty(app);
    const int code = work();
    flush_results();
    return code;
  } catch (const UsageError& e) {
    return fail_told(2, e.what());
  } catch (const Error& e) {
    return fail_told(1, e.what());
  } catch (const std::bad_alloc&) {
    return fail_told(1, kNoMemory);
  } catch (const std::filesystem::filesystem_error& e) {
    return fail_told(1, excerpt(e.path1().string()) + ": " + e.code().message() + what_to_do(e.code()));
  } catch (const std::exception& e) {
    return fail_told(1, std::string("unexpected: ") + e.what());
  }
}

}  // namespace padder::cli
