// SPDX-License-Identifier: Apache-2.0

// The player in a window on a virtual display, driven by a script of its own verbs.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "formats/bundle/case_bundle.h"
#include "formats/files/load_save.h"
#include "support/paths.h"
#include "support/run_command.h"
#include "support/temporary_folder.h"

namespace sonocase::testing {

class WindowRun : public ::testing::Test {
  protected:
    // The case that is played, and its file's name.
    WindowRun(const CaseBundle& bundle, const std::string& name) : bundle_(folder_ / name) {
        EXPECT_TRUE(save_bundle(bundle, bundle_));
    }

    // The command line that plays the case by this script. What it does not save is not drawn.
    std::string command(const std::string& arguments,
                        const std::string& script,
                        const std::string& size = "1280x720") {
        folder_.write("script", "only-shots\n" + script);
        return SONOCASE_BIN "/sonoplay " + bundle_ + " --size " + size + " " + arguments +
               " --script " + (folder_ / "script");
    }
    // A shell's line with a display, and settings and recordings of its own.
    CommandResult in_display(const std::string& line,
                             const std::string& language = "C",
                             const std::string& size = "1280x720") {
        folder_.write("line.sh", line + "\n");
        return run_command("env LC_ALL=" + language + " XDG_CONFIG_HOME=" + (folder_ / "config") +
                           " XDG_DATA_HOME=" + (folder_ / "data") +
                           " " SONOCASE_SOURCE "/tests/support/on-display " + size + " sh " +
                           (folder_ / "line.sh"));
    }

    // A picture that a script saves, and the script's line for it.
    std::string file(const std::string& name) { return folder_ / (name + ".png"); }
    std::string shot(const std::string& name) { return "shot " + file(name) + "\n"; }
    // Whether its words and controls have these.
    bool says(const std::string& name, const std::string& words) {
        return read_text(file(name) + ".boxes").find(words) != std::string::npos;
    }

    TemporaryFolder folder_;
    std::string bundle_;
};

}  // namespace sonocase::testing
