// SPDX-License-Identifier: Apache-2.0

// The bundles that the start page offers.
#pragma once

#include <string>
#include <vector>

namespace sonocase::runtime {

struct BundleEntry {
    std::string path;
    std::string name;  // file name without its extension
    std::string folder;
    double megabytes = 0;
    bool recent = false;
};

// recent  bundles opened before, newest first; those that exist come first in the list
// Then those in the data folders of the user and the system, in the current folder and in its out/.
std::vector<BundleEntry> find_bundles(const std::vector<std::string>& recent);

// Moves `path` to the front of `recent`, as an absolute path; at most kMostRecent are kept.
inline constexpr std::size_t kMostRecent = 12;
void remember_bundle(const std::string& path, std::vector<std::string>& recent);

}  // namespace sonocase::runtime
