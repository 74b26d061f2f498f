// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cstring>

#include "formats/container/chunk_file.h"

namespace sonocase {
namespace {

// Types as the table has them, of bytes that need not be valid.
std::vector<std::string> types_of(std::span<const std::uint8_t> bytes) {
    constexpr std::size_t kHeaderBytes = 64, kEntryBytes = 64, kTypeBytes = 8;
    std::vector<std::string> types;
    if (bytes.size() < kHeaderBytes) return types;
    std::uint32_t count = 0;
    std::memcpy(&count, bytes.data() + 24, sizeof count);
    for (std::size_t at = kHeaderBytes; count > 0 && bytes.size() - at >= kEntryBytes;
         at += kEntryBytes, --count) {
        const std::uint8_t* from = bytes.data() + at;
        types.emplace_back(from, std::find(from, from + kTypeBytes, std::uint8_t{0}));
    }
    return types;
}

}  // namespace

Result<std::vector<std::uint8_t>> rearranged(std::span<const std::uint8_t> bytes,
                                             std::string_view kind,
                                             std::span<const std::string_view> order,
                                             int level,
                                             const std::string& where,
                                             JobRunner& jobs) {
    std::vector<std::string> types = types_of(bytes);
    const std::vector<std::string_view> known(types.begin(), types.end());
    const auto reader = ChunkReader::open(bytes, kind, known, where);
    if (!reader) return reader.error();
    const auto rank = [&](const std::string& type) {
        return std::find(order.begin(), order.end(), type) - order.begin();
    };
    std::stable_sort(types.begin(), types.end(),
                     [&](const std::string& a, const std::string& b) { return rank(a) < rank(b); });
    ChunkWriter writer{std::string(kind)};
    for (const std::string& type : types) {
        if (reader->is_compressed(type)) {
            auto raw = reader->read(type, reader->raw_bytes(type), jobs);
            if (!raw) return raw.error();
            writer.add(type, reader->is_required(type), std::move(*raw));
        } else {
            const auto packed = reader->packed(type);
            if (!packed) return packed.error();
            writer.add_packed(type, reader->is_required(type),
                              std::vector<std::uint8_t>(packed->begin(), packed->end()));
        }
    }
    return writer.write(jobs, level);
}

}  // namespace sonocase
