// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/input_digests.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <vector>

#include <sys/stat.h>

#include "formats/base/digest.h"
#include "formats/files/atomic_file.h"

namespace sonocase::pipeline::inline cook {

namespace fs = std::filesystem;

Result<std::string> digest_of_input(
    const std::string& path,
    const std::function<Result<std::string>(const std::string&)>& of_file) {
    std::error_code code;
    if (!fs::exists(path, code))
        return Error{"no such file or folder", path,
                     "check the path, or say with --data where the recipe's inputs are"};
    if (!fs::is_directory(path, code)) return of_file(path);
    std::vector<std::string> files;
    for (auto it = fs::recursive_directory_iterator(path, code);
         !code && it != fs::recursive_directory_iterator(); it.increment(code)) {
        std::error_code item_code;
        if (it->is_regular_file(item_code))
            files.push_back(fs::relative(it->path(), path, item_code).generic_string());
    }
    if (code)
        return Error{"cannot list the folder: " + code.message(), path,
                     "check that it may be read"};
    std::sort(files.begin(), files.end());
    Digest digest;
    for (const std::string& file : files) {
        SONOCASE_TRY(auto one, of_file((fs::path(path) / file).string()));
        digest.add(std::string_view(file)).add(std::string_view(one));
    }
    return digest.hex();
}

Result<InputDigests> digest_inputs(const Recipe& recipe, const DigestOfInput& digest) {
    InputDigests inputs;
    const RecipeInputs& in = recipe.inputs;
    struct Item {
        const std::string& given;
        std::string& to;
    };
    for (const Item& item : {Item{in.labels, inputs.labels},
                             {in.label_table, inputs.label_table},
                             {in.scan, inputs.scan},
                             {in.surface, inputs.surface},
                             {in.examples, inputs.examples},
                             {in.landmarks, inputs.landmarks},
                             {in.surface_landmarks, inputs.landmarks}}) {
        if (item.given.empty()) continue;
        SONOCASE_TRY(auto hash, digest(recipe.resolve(item.given)));
        item.to += hash;
        inputs.files.push_back({item.given, std::move(hash)});
    }
    return inputs;
}

namespace {

constexpr std::size_t kDigestLength = 32;
constexpr std::int64_t kFreshNs = 10'000'000'000;

std::int64_t nanoseconds(const timespec& time) {
    return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

// "inode size modified changed path"; empty where there is no such file. age_ns: since the change.
std::string signature(const std::string& path, std::int64_t* age_ns) {
    struct stat status {};
    if (::stat(path.c_str(), &status) != 0) return {};
    timespec now{};
    clock_gettime(CLOCK_REALTIME, &now);
    *age_ns = nanoseconds(now) - nanoseconds(status.st_ctim);
    return std::to_string(status.st_ino) + " " + std::to_string(status.st_size) + " " +
           std::to_string(nanoseconds(status.st_mtim)) + " " +
           std::to_string(nanoseconds(status.st_ctim)) + " " + path;
}

}  // namespace

DigestMemo::DigestMemo(std::string path) : path_(std::move(path)) {
    std::error_code code;
    if (!std::filesystem::exists(path_, code)) return;
    auto text = read_text_file(path_);
    if (!text) return;
    saved_ = std::move(*text);
    for (std::size_t at = 0; at < saved_.size();) {
        const std::size_t end = std::min(saved_.find('\n', at), saved_.size());
        if (end > at + kDigestLength + 1)
            known_[saved_.substr(at + kDigestLength + 1, end - at - kDigestLength - 1)] =
                saved_.substr(at, kDigestLength);
        at = end + 1;
    }
}

Result<std::string> DigestMemo::of_file(const std::string& path) {
    std::int64_t age_ns = 0;
    const std::string before = signature(path, &age_ns);
    if (const auto found = known_.find(before); !before.empty() && found != known_.end()) {
        current_[before] = found->second;
        return found->second;
    }
    auto digest = digest_of_file(path);
    std::int64_t ignored_ns = 0;
    if (digest && age_ns > kFreshNs && path.find('\n') == std::string::npos &&
        signature(path, &ignored_ns) == before)
        current_[before] = *digest;
    return digest;
}

Result<std::string> DigestMemo::digest(const std::string& path) {
    return digest_of_input(path, [this](const std::string& file) { return of_file(file); });
}

Status DigestMemo::save() const {
    std::vector<std::string> lines;
    for (const auto& [name, digest] : current_) lines.push_back(digest + " " + name + "\n");
    std::sort(lines.begin(), lines.end());
    std::string text;
    for (const std::string& line : lines) text += line;
    if (text == saved_) return Done{};
    return write_file(path_, text);
}

}  // namespace sonocase::pipeline::inline cook
