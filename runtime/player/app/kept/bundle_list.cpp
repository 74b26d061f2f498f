// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/kept/bundle_list.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "runtime/player/app/kept/user_folders.h"

namespace sonocase::runtime {

namespace fs = std::filesystem;

namespace {

// The first bytes of every bundle (docs/format.md): a file that was cut off or is something else is
// not offered.
bool looks_like_a_bundle(const fs::path& path) {
    constexpr unsigned char kMagic[] = {0x89, 'S', 'O', 'N', 'O'};
    constexpr std::uintmax_t kLeastBytes = 64;
    std::error_code failed;
    if (fs::file_size(path, failed) < kLeastBytes || failed) return false;
    char first[sizeof kMagic] = {};
    std::ifstream in(path, std::ios::binary);
    return in.read(first, sizeof first) && std::memcmp(first, kMagic, sizeof kMagic) == 0;
}

}  // namespace

std::vector<BundleEntry> find_bundles(const std::vector<std::string>& recent) {
    std::vector<BundleEntry> entries;
    std::set<std::string> seen;
    const auto add = [&](const fs::path& path, bool is_recent) {
        std::error_code failed;
        const fs::path whole = fs::weakly_canonical(path, failed);
        if (failed || !fs::is_regular_file(whole, failed)) return;
        if (!looks_like_a_bundle(whole)) return;
        if (!seen.insert(whole.string()).second) return;
        BundleEntry entry;
        entry.path = whole.string();
        entry.name = whole.stem().string();
        entry.folder = whole.parent_path().string();
        entry.megabytes = static_cast<double>(fs::file_size(whole, failed)) / 1e6;
        entry.recent = is_recent;
        entries.push_back(entry);
    };
    for (const std::string& path : recent) add(path, true);
    std::vector<fs::path> folders;
    if (!data_folder().empty()) folders.push_back(data_folder() + "/cases");
    std::stringstream system(std::getenv("XDG_DATA_DIRS") ? std::getenv("XDG_DATA_DIRS")
                                                          : "/usr/local/share:/usr/share");
    for (std::string root; std::getline(system, root, ':');) {
        if (!root.empty()) folders.push_back(root + "/sonocase/cases");
    }
    folders.push_back(fs::path("."));
    folders.push_back(fs::path("out"));
    for (const fs::path& folder : folders) {
        std::error_code failed;
        std::vector<fs::path> found;
        for (fs::directory_iterator it(folder, failed), end; !failed && it != end;
             it.increment(failed)) {
            if (it->path().extension() == ".sonocase") found.push_back(it->path());
        }
        std::sort(found.begin(), found.end());
        for (const fs::path& path : found) add(path, false);
    }
    return entries;
}

void remember_bundle(const std::string& path, std::vector<std::string>& recent) {
    std::error_code ignored;
    const std::string whole = fs::weakly_canonical(path, ignored).string();
    recent.erase(std::remove(recent.begin(), recent.end(), whole), recent.end());
    recent.insert(recent.begin(), whole);
    if (recent.size() > kMostRecent) recent.resize(kMostRecent);
}

}  // namespace sonocase::runtime
