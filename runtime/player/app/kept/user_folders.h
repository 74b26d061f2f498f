// SPDX-License-Identifier: Apache-2.0

// The user's XDG folders for this program.
#pragma once

#include <string>

namespace sonocase::runtime {

// $XDG_CONFIG_HOME/sonocase, else ~/.config/sonocase; empty without a home folder.
std::string config_folder();
// $XDG_DATA_HOME/sonocase, else ~/.local/share/sonocase: cases/, calibrations/, sessions/; empty
// without a home folder.
std::string data_folder();

// "~" or "~/x" with the user's home folder in place of "~", as a shell does it; anything else
// unchanged.
std::string expand_home(const std::string& path);

}  // namespace sonocase::runtime
