// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/stage_cache.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <ratio>
#include <sstream>

#include "formats/base/digest.h"
#include "formats/files/atomic_file.h"

namespace sonocase::pipeline::inline stages {
namespace {

namespace fs = std::filesystem;

// An entry's first line: "sonocase-cache 2 KEY DIGEST SECONDS SIZE CHECK\n", CHECK being the hash
// of what stands before it.
constexpr std::string_view kMagic = "sonocase-cache 2 ";
constexpr std::size_t kLongestHeader = 256;

struct Header {
    std::string digest;
    double seconds = 0;
    std::uint64_t size = 0;
};

std::string header_text(const std::string& key, const Header& header) {
    char seconds[32];
    const auto end = std::to_chars(seconds, seconds + sizeof seconds, header.seconds).ptr;
    const std::string text = std::string(kMagic) + key + " " + header.digest + " " +
                             std::string(seconds, end) + " " + std::to_string(header.size) + " ";
    return text + digest_of(text).substr(0, 16) + "\n";
}

// Empty where the line is not exactly what it would be for these values.
std::optional<Header> parse_header(const std::string& line, const std::string& key) {
    Header header;
    std::istringstream in(line);
    std::string word, version, own_key, seconds;
    if (!(in >> word >> version >> own_key >> header.digest >> seconds >> header.size)) return {};
    const auto [end, code] =
        std::from_chars(seconds.data(), seconds.data() + seconds.size(), header.seconds);
    if (code != std::errc() || header_text(key, header) != line) return {};
    return header;
}

bool exists(const std::string& path) {
    std::error_code code;
    return fs::exists(path, code);
}

void mark_used(const std::string& path) {
    std::error_code code;  // a folder that may only be read is not an error
    fs::last_write_time(path, fs::file_time_type::clock::now(), code);
}

struct Item {
    fs::path path;
    fs::file_time_type used;
    std::uint64_t size;
};

std::vector<Item> entries_of(const std::string& folder) {
    std::vector<Item> items;
    std::error_code code;
    for (auto it = fs::recursive_directory_iterator(folder, code);
         !code && it != fs::recursive_directory_iterator(); it.increment(code)) {
        std::error_code item_code;
        if (!it->is_regular_file(item_code) || it->path().filename().string().starts_with('.'))
            continue;
        const std::uint64_t size = it->file_size(item_code);
        const auto used = it->last_write_time(item_code);
        if (!item_code) items.push_back({it->path(), used, size});  // else another removed it
    }
    return items;
}

}  // namespace

StageCache::StageCache(std::string folder, std::uint64_t limit_bytes)
    : folder_(std::move(folder)), limit_bytes_(limit_bytes) {}

std::string StageCache::path_of(const std::string& stage, const std::string& key) const {
    return (fs::path(folder_) / stage / key.substr(0, 2) / key).string();
}

std::optional<CacheEntry> StageCache::find(const std::string& stage,
                                           const std::string& key,
                                           bool* damaged) const {
    if (damaged != nullptr) *damaged = false;
    if (!enabled()) return std::nullopt;
    const std::string path = path_of(stage, key);
    if (!exists(path)) return std::nullopt;
    auto bytes = read_file(path);
    if (!bytes && !exists(path)) return std::nullopt;  // removed by another just now
    if (damaged != nullptr) *damaged = true;           // unless proven whole below
    if (!bytes) return std::nullopt;
    const auto line_end = std::find(bytes->begin(), bytes->end(), std::uint8_t{'\n'});
    if (line_end == bytes->end()) return std::nullopt;
    const auto header = parse_header(std::string(bytes->begin(), line_end + 1), key);
    if (!header) return std::nullopt;
    bytes->erase(bytes->begin(), line_end + 1);
    if (bytes->size() != header->size || digest_of(*bytes) != header->digest) return std::nullopt;
    mark_used(path);
    if (damaged != nullptr) *damaged = false;
    return CacheEntry{std::move(*bytes), header->digest, header->seconds};
}

std::optional<std::string> StageCache::digest_in(const std::string& stage,
                                                 const std::string& key) const {
    if (!enabled()) return std::nullopt;
    const std::string path = path_of(stage, key);
    std::FILE* file = std::fopen(path.c_str(), "rbe");
    if (file == nullptr) return std::nullopt;
    std::string line(kLongestHeader, '\0');
    line.resize(std::fread(line.data(), 1, line.size(), file));
    const bool seekable = std::fseek(file, 0, SEEK_END) == 0;
    const long whole = seekable ? std::ftell(file) : -1;
    std::fclose(file);
    line.resize(std::min(line.size(), line.find('\n') + 1));
    const auto header = parse_header(line, key);
    if (!header || whole < 0 || static_cast<std::uint64_t>(whole) != line.size() + header->size)
        return std::nullopt;
    mark_used(path);
    return header->digest;
}

Status StageCache::store(const std::string& stage,
                         const std::string& key,
                         const CacheEntry& entry) const {
    if (!enabled()) return Done{};
    const std::string header = header_text(key, {entry.digest, entry.seconds, entry.bytes.size()});
    std::vector<std::uint8_t> bytes(header.begin(), header.end());
    bytes.insert(bytes.end(), entry.bytes.begin(), entry.bytes.end());
    if (auto status = write_file(path_of(stage, key), bytes); !status) return status;
    if (limit_bytes_ > 0) {
        remove_leftovers(folder_);
        trim();
    }
    return Done{};
}

CacheSummary StageCache::trim() const {
    CacheSummary summary;
    std::vector<Item> items = entries_of(folder_);
    summary.entries = items.size();
    for (const Item& item : items) summary.bytes += item.size;
    if (limit_bytes_ == 0 || summary.bytes <= limit_bytes_) return summary;
    std::sort(items.begin(), items.end(), [](const Item& a, const Item& b) {
        return a.used != b.used ? a.used < b.used : a.path < b.path;
    });
    for (const Item& item : items) {
        if (summary.bytes <= limit_bytes_ / 10 * 9) break;
        std::error_code code;
        const bool removed = fs::remove(item.path, code);
        if (code) continue;
        // An entry that another program removed at the same time is gone as well.
        summary.evicted += removed ? 1 : 0;
        summary.bytes -= item.size;
        --summary.entries;
    }
    return summary;
}

CacheSummary StageCache::tidy(bool verify, double longest_days) const {
    if (!enabled()) return {};
    const std::size_t leftovers = remove_leftovers(folder_);
    std::size_t damaged = 0;
    if (verify)
        for (const Item& item : entries_of(folder_)) {
            const std::string stage = item.path.parent_path().parent_path().filename().string();
            bool bad = false;
            find(stage, item.path.filename().string(), &bad);
            std::error_code code;
            if (bad && fs::remove(item.path, code)) ++damaged;
            // Verifying an entry does not count as using it.
            if (!bad) fs::last_write_time(item.path, item.used, code);
        }
    std::size_t old = 0;
    if (longest_days > 0) {
        const std::chrono::duration<double, std::ratio<86400>> longest(longest_days);
        for (const Item& item : entries_of(folder_)) {
            std::error_code code;
            if (fs::file_time_type::clock::now() - item.used > longest)
                old += fs::remove(item.path, code) ? 1 : 0;
        }
    }
    CacheSummary summary = trim();
    summary.old = old;
    summary.leftovers = leftovers;
    summary.damaged = damaged;
    return summary;
}

}  // namespace sonocase::pipeline::inline stages
