#include "pipeline/cook/stage_cache.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstring>
#include <filesystem>

#include "formats/digest.h"
#include "pipeline/files.h"

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;

// An entry's first line: "sonocase-cache 1 KEY DIGEST SECONDS SIZE\n".
constexpr std::string_view kMagic = "sonocase-cache 1 ";

std::string header_of(const std::string& key, const CacheEntry& entry) {
    char seconds[32];
    const auto end = std::to_chars(seconds, seconds + sizeof seconds, entry.seconds).ptr;
    return std::string(kMagic) + key + " " + entry.digest + " " + std::string(seconds, end) + " " +
           std::to_string(entry.bytes.size()) + "\n";
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
    std::error_code code;
    if (!fs::exists(path, code)) return std::nullopt;
    if (damaged != nullptr) *damaged = true;  // until shown otherwise
    auto bytes = read_file(path);
    if (!bytes) return std::nullopt;
    const auto line_end = std::find(bytes->begin(), bytes->end(), std::uint8_t{'\n'});
    if (line_end == bytes->end()) return std::nullopt;
    const std::string header(bytes->begin(), line_end + 1);
    CacheEntry entry;
    entry.bytes.assign(line_end + 1, bytes->end());
    entry.digest = digest_of(entry.bytes);
    // The header must be exactly what it would be for these bytes, but for the seconds in it.
    const std::string before = std::string(kMagic) + key + " " + entry.digest + " ";
    if (!header.starts_with(before)) return std::nullopt;
    const char* first = header.data() + before.size();
    const auto [end, parse] = std::from_chars(first, header.data() + header.size(), entry.seconds);
    if (parse != std::errc() || header_of(key, entry) != header) return std::nullopt;
    fs::last_write_time(path, fs::file_time_type::clock::now(), code);
    if (damaged != nullptr) *damaged = false;
    return entry;
}

Status StageCache::store(const std::string& stage,
                         const std::string& key,
                         const CacheEntry& entry) const {
    if (!enabled()) return Done{};
    const std::string header = header_of(key, entry);
    std::vector<std::uint8_t> bytes(header.begin(), header.end());
    bytes.insert(bytes.end(), entry.bytes.begin(), entry.bytes.end());
    if (auto status = write_file(path_of(stage, key), bytes); !status) return status;
    trim();
    return Done{};
}

void StageCache::trim() const {
    if (limit_bytes_ == 0) return;
    struct Item {
        fs::path path;
        fs::file_time_type used;
        std::uint64_t size;
    };
    std::vector<Item> items;
    std::uint64_t total = 0;
    std::error_code code;
    const auto now = fs::file_time_type::clock::now();
    for (auto it = fs::recursive_directory_iterator(folder_, code);
         !code && it != fs::recursive_directory_iterator(); it.increment(code)) {
        std::error_code item_code;
        if (!it->is_regular_file(item_code)) continue;
        const std::uint64_t size = it->file_size(item_code);
        const auto used = it->last_write_time(item_code);
        if (item_code) continue;  // another machine removed it
        // A temporary of a program that was killed; a living one is never an hour old.
        if (it->path().filename().string().starts_with('.')) {
            if (now - used > std::chrono::hours(1)) fs::remove(it->path(), item_code);
            continue;
        }
        items.push_back({it->path(), used, size});
        total += size;
    }
    if (total <= limit_bytes_) return;
    std::sort(items.begin(), items.end(), [](const Item& a, const Item& b) {
        return a.used != b.used ? a.used < b.used : a.path < b.path;
    });
    for (const Item& item : items) {
        if (total <= limit_bytes_ / 10 * 9) break;
        std::error_code remove_code;
        if (fs::remove(item.path, remove_code)) total -= item.size;
    }
}

}  // namespace sonocase::pipeline
