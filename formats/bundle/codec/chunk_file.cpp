// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/chunk_file.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cassert>
#include <cstring>

#include <xxhash.h>
#include <zstd.h>

#include "formats/base/memory.h"

namespace sonocase {
namespace {

static_assert(std::endian::native == std::endian::little,
              "the formats are little-endian in memory");

// A byte above 127, line ends of both kinds and an end-of-file mark: a file that was transferred as
// text no longer begins like this.
constexpr std::array<std::uint8_t, 8> kMagic{0x89, 'S', 'O', 'N', 'O', 0x0D, 0x0A, 0x1A};
constexpr std::size_t kHeaderBytes = 64;
constexpr std::size_t kEntryBytes = 64;
constexpr std::uint32_t kRequired = 1;
constexpr std::uint32_t kZstd = 2;
constexpr const char* kRemake = "the file is damaged; copy it again or make it again";

template <class T>
T get(std::span<const std::uint8_t> bytes, std::size_t offset) {
    T value;
    std::memcpy(&value, bytes.data() + offset, sizeof(T));
    return value;
}
template <class T>
void put(std::span<std::uint8_t> bytes, std::size_t offset, T value) {
    std::memcpy(bytes.data() + offset, &value, sizeof(T));
}

std::size_t aligned(std::size_t offset) {
    return (offset + kChunkAlignment - 1) / kChunkAlignment * kChunkAlignment;
}

// Independent zstd frames of kFrameBytes each, so that they can be compressed and decompressed in
// parallel. Empty when compression saves less than an eighth.
std::vector<std::uint8_t> compressed(std::span<const std::uint8_t> raw,
                                     int level,
                                     JobRunner& jobs) {
    if (raw.size() < 64) return {};
    const std::size_t frames = (raw.size() + kFrameBytes - 1) / kFrameBytes;
    std::vector<std::vector<std::uint8_t>> parts(frames);
    jobs.run(frames, [&](std::size_t i) {
        const auto from =
            raw.subspan(i * kFrameBytes, std::min(kFrameBytes, raw.size() - i * kFrameBytes));
        parts[i].resize(ZSTD_compressBound(from.size()));
        const std::size_t n =
            ZSTD_compress(parts[i].data(), parts[i].size(), from.data(), from.size(), level);
        parts[i].resize(ZSTD_isError(n) ? 0 : n);
    });
    std::size_t total = 0;
    for (const auto& part : parts) {
        if (part.empty()) return {};
        total += part.size();
    }
    if (total > raw.size() - raw.size() / 8) return {};
    std::vector<std::uint8_t> out;
    out.reserve(total);
    for (const auto& part : parts) out.insert(out.end(), part.begin(), part.end());
    return out;
}

std::string text_of(std::span<const std::uint8_t> bytes) {
    std::string text;
    for (const std::uint8_t b : bytes) {
        if (b == 0) break;
        text += b >= 32 && b < 127 ? static_cast<char>(b) : '?';
    }
    return text;
}

std::string entry_name(std::size_t i, const std::string& type) {
    return "chunk " + std::to_string(i) + " '" + type + "'";
}

bool all_zero(std::span<const std::uint8_t> bytes) {
    return std::all_of(bytes.begin(), bytes.end(), [](std::uint8_t b) { return b == 0; });
}

}  // namespace

ChunkWriter::ChunkWriter(std::string kind) : kind_(std::move(kind)) {
    assert(kind_.size() == 4);
}

void ChunkWriter::add(std::string type, bool required, std::vector<std::uint8_t> bytes) {
    assert(!type.empty() && type.size() <= 8 && chunks_.size() < kMaxChunks);
    chunks_.push_back({std::move(type), required, std::move(bytes), {}});
    // A vector's storage stays where it is when the chunk itself is moved.
    chunks_.back().view = chunks_.back().owned;
}

void ChunkWriter::add_view(std::string type, bool required, std::span<const std::uint8_t> bytes) {
    assert(!type.empty() && type.size() <= 8 && chunks_.size() < kMaxChunks);
    chunks_.push_back({std::move(type), required, {}, bytes});
}

void ChunkWriter::add_packed(std::string type, bool required, std::vector<std::uint8_t> bytes) {
    add(std::move(type), required, std::move(bytes));
    chunks_.back().packed = true;
}

std::vector<std::uint8_t> ChunkWriter::write(JobRunner& jobs, int level) const {
    const std::size_t table_bytes = kEntryBytes * chunks_.size();
    std::vector<std::uint8_t> out(kHeaderBytes + table_bytes);
    for (std::size_t i = 0; i < chunks_.size(); ++i) {
        const Chunk& chunk = chunks_[i];
        const std::vector<std::uint8_t> packed =
            chunk.packed ? std::vector<std::uint8_t>() : compressed(chunk.view, level, jobs);
        const std::span<const std::uint8_t> stored =
            packed.empty() ? chunk.view : std::span(packed);
        const std::size_t offset = aligned(out.size());
        out.resize(offset);
        out.insert(out.end(), stored.begin(), stored.end());
        const std::size_t entry = kHeaderBytes + i * kEntryBytes;
        std::memcpy(out.data() + entry, chunk.type.data(), chunk.type.size());
        put<std::uint32_t>(out, entry + 8,
                           (chunk.required ? kRequired : 0) | (packed.empty() ? 0 : kZstd));
        put<std::uint64_t>(out, entry + 16, offset);
        put<std::uint64_t>(out, entry + 24, stored.size());
        put<std::uint64_t>(out, entry + 32, chunk.view.size());
        put<std::uint64_t>(out, entry + 40, XXH3_64bits(stored.data(), stored.size()));
    }
    std::copy(kMagic.begin(), kMagic.end(), out.begin());
    put<std::uint32_t>(out, 8, kContainerVersion);
    std::memcpy(out.data() + 12, kind_.data(), 4);
    put<std::uint64_t>(out, 16, out.size());
    put<std::uint32_t>(out, 24, static_cast<std::uint32_t>(chunks_.size()));
    put<std::uint64_t>(out, 48, XXH3_64bits(out.data() + kHeaderBytes, table_bytes));
    put<std::uint64_t>(out, 56, XXH3_64bits(out.data(), 56));
    return out;
}

Error ChunkReader::fault(const std::string& what, const std::string& expected) const {
    return {what, where_, expected};
}

Result<ChunkReader> ChunkReader::open(std::span<const std::uint8_t> bytes,
                                      std::string_view kind,
                                      std::span<const std::string_view> known,
                                      const std::string& where,
                                      const Arrivals* arrivals) {
    ChunkReader reader;
    reader.bytes_ = bytes;
    reader.where_ = where;
    reader.arrivals_ = arrivals;
    if (bytes.size() >= kHeaderBytes && !reader.has_bytes({0, kHeaderBytes}))
        return reader.fault("has not arrived yet", "load its beginning first");
    SONOCASE_TRY_DONE(reader.check_header(kind));
    const std::size_t count = get<std::uint32_t>(bytes, 24);
    const auto table = bytes.subspan(kHeaderBytes, count * kEntryBytes);
    std::size_t end = kHeaderBytes + table.size();
    for (std::size_t i = 0; i < count; ++i) {
        const auto raw = table.subspan(i * kEntryBytes, kEntryBytes);
        SONOCASE_TRY(auto entry, reader.read_entry(raw, i, end));
        const bool is_known = std::find(known.begin(), known.end(), entry.type) != known.end();
        if (entry.required && !is_known) {
            return reader.fault(
                entry_name(i, entry.type) + " is required and not known to this program",
                "update the program");
        }
        end = entry.offset + entry.stored;
        if (is_known) reader.entries_.push_back(std::move(entry));
    }
    if (end != bytes.size()) return reader.fault("bytes follow the last chunk", kRemake);
    return reader;
}

// Everything before the entries: the header, and the table's size and checksum.
Status ChunkReader::check_header(std::string_view kind) const {
    const auto bytes = bytes_;
    if (bytes.size() < kMagic.size() || !std::equal(kMagic.begin(), kMagic.end(), bytes.begin())) {
        return fault("is not a sonocase file (wrong first bytes)", "give a file made by sonocase");
    }
    if (bytes.size() < kHeaderBytes) return fault("ends inside its header", kRemake);
    const std::uint32_t version = get<std::uint32_t>(bytes, 8);
    const bool header_whole = get<std::uint64_t>(bytes, 56) == XXH3_64bits(bytes.data(), 56);
    if (header_whole && version > kContainerVersion) {
        return fault("has format version " + std::to_string(version),
                     "this program reads up to version " + std::to_string(kContainerVersion) +
                         "; update it or make the file again with it");
    }
    if (!header_whole) return fault("header checksum does not match", kRemake);
    if (version == 0) return fault("has format version 0", kRemake);
    const std::string found = text_of(bytes.subspan(12, 4));
    if (found != kind) {
        return fault("is a file of kind '" + found + "'",
                     "a file of kind '" + std::string(kind) + "' is needed here");
    }
    const std::uint64_t size = get<std::uint64_t>(bytes, 16);
    if (size > bytes.size()) {
        return fault(
            "holds " + std::to_string(bytes.size()) + " of " + std::to_string(size) + " bytes",
            "the file was cut short; copy it again");
    }
    if (size < bytes.size()) {
        return fault(std::to_string(bytes.size() - size) + " bytes follow the end", kRemake);
    }
    const std::size_t count = get<std::uint32_t>(bytes, 24);
    if (count == 0 || count > kMaxChunks || kHeaderBytes + count * kEntryBytes > bytes.size()) {
        return fault("table of " + std::to_string(count) + " chunks does not fit the file",
                     kRemake);
    }
    if (!has_bytes({kHeaderBytes, count * kEntryBytes}))
        return fault("has not arrived yet", "load its beginning first");
    if (!all_zero(bytes.subspan(28, 20)))
        return fault("reserved header bytes are not zero", kRemake);
    const auto table = bytes.subspan(kHeaderBytes, count * kEntryBytes);
    if (get<std::uint64_t>(bytes, 48) != XXH3_64bits(table.data(), table.size())) {
        return fault("table checksum does not match", kRemake);
    }
    return Done{};
}

// raw: entry i of the table. end: where the chunk before it ends.
Result<ChunkReader::Entry> ChunkReader::read_entry(std::span<const std::uint8_t> raw,
                                                   std::size_t i,
                                                   std::size_t end) const {
    Entry entry;
    entry.type = text_of(raw.subspan(0, 8));
    const std::uint32_t flags = get<std::uint32_t>(raw, 8);
    const std::uint64_t offset = get<std::uint64_t>(raw, 16);
    const std::uint64_t stored = get<std::uint64_t>(raw, 24);
    const std::uint64_t unpacked = get<std::uint64_t>(raw, 32);
    const std::string name = entry_name(i, entry.type);
    if (offset != aligned(end) || offset > bytes_.size() || stored > bytes_.size() - offset) {
        return fault(name + " at offset " + std::to_string(offset) + " is out of place", kRemake);
    }
    const ByteRange padding{end, static_cast<std::size_t>(offset) - end};
    if (has_bytes(padding) && !all_zero(bytes_.subspan(padding.at, padding.count))) {
        return fault("bytes before " + name + " are not zero", kRemake);
    }
    if ((flags & ~(kRequired | kZstd)) != 0 || !all_zero(raw.subspan(12, 4)) ||
        !all_zero(raw.subspan(48, 16))) {
        return fault(name + " has unknown flags", "update the program");
    }
    entry.required = (flags & kRequired) != 0;
    entry.compressed = (flags & kZstd) != 0;
    if ((!entry.compressed && unpacked != stored) || unpacked > SIZE_MAX / 2) {
        return fault(name + " has an impossible size", kRemake);
    }
    if (find(entry.type)) return fault(name + " occurs twice", kRemake);
    entry.offset = static_cast<std::size_t>(offset);
    entry.stored = static_cast<std::size_t>(stored);
    entry.raw = static_cast<std::size_t>(unpacked);
    entry.checksum = get<std::uint64_t>(raw, 40);
    return entry;
}

const ChunkReader::Entry* ChunkReader::find(std::string_view type) const {
    for (const Entry& entry : entries_) {
        if (entry.type == type) return &entry;
    }
    return nullptr;
}

bool ChunkReader::has(std::string_view type) const {
    return find(type) != nullptr;
}

bool ChunkReader::is_compressed(std::string_view type) const {
    const Entry* entry = find(type);
    return entry != nullptr && entry->compressed;
}

bool ChunkReader::is_required(std::string_view type) const {
    const Entry* entry = find(type);
    return entry != nullptr && entry->required;
}

ByteRange ChunkReader::place(std::string_view type) const {
    const Entry* entry = find(type);
    return entry ? ByteRange{entry->offset, entry->stored} : ByteRange{};
}

bool ChunkReader::is_loaded(std::string_view type) const {
    return has_bytes(place(type));
}

std::size_t ChunkReader::raw_bytes(std::string_view type) const {
    const Entry* entry = find(type);
    return entry ? entry->raw : 0;
}

Status ChunkReader::check_size(std::string_view type,
                               std::size_t count,
                               std::size_t bytes_each) const {
    const Entry* entry = find(type);
    if (!entry) return fault("chunk '" + std::string(type) + "' is missing", "make the file again");
    if (count > SIZE_MAX / 2 / bytes_each || entry->raw != count * bytes_each) {
        return fault(
            "chunk '" + std::string(type) + "' holds " + std::to_string(entry->raw) + " bytes",
            "the manifest calls for " + std::to_string(count) + " values of " +
                std::to_string(bytes_each) + " bytes");
    }
    // A small file must not ask for much memory: a zstd frame takes at least 9 bytes.
    if (entry->compressed && entry->raw / kFrameBytes > entry->stored / 9) {
        return fault("chunk '" + std::string(type) + "' claims more than it can hold",
                     "make the file again");
    }
    if (!can_allocate(entry->raw))
        return fault("chunk '" + entry->type + "' needs more memory than is available");
    return Done{};
}

Result<std::vector<std::uint8_t>> ChunkReader::read(std::string_view type,
                                                    std::size_t max_bytes,
                                                    JobRunner& jobs) const {
    if (raw_bytes(type) > max_bytes) {
        return fault(
            "chunk '" + std::string(type) + "' holds " + std::to_string(raw_bytes(type)) + " bytes",
            "at most " + std::to_string(max_bytes) + " are expected");
    }
    return read_array<std::uint8_t>(type, raw_bytes(type), jobs);
}

Status ChunkReader::check_sum(const Entry& entry) const {
    if (!has_bytes({entry.offset, entry.stored}))
        return fault("chunk '" + entry.type + "' has not arrived yet", "load it first");
    if (XXH3_64bits(bytes_.data() + entry.offset, entry.stored) == entry.checksum) return Done{};
    return fault("chunk '" + entry.type + "' checksum does not match", kRemake);
}

Result<std::span<const std::uint8_t>> ChunkReader::packed(std::string_view type) const {
    const Entry* entry = find(type);
    if (!entry) return fault("chunk '" + std::string(type) + "' is missing", "make the file again");
    if (entry->compressed)
        return fault("chunk '" + entry->type + "' is compressed twice", "make the file again");
    SONOCASE_TRY_DONE(check_sum(*entry));
    return bytes_.subspan(entry->offset, entry->stored);
}

Result<std::span<const std::uint8_t>> ChunkReader::packed_in_part(std::string_view type,
                                                                  std::size_t head) const {
    const Entry* entry = find(type);
    if (!entry || is_loaded(type)) return packed(type);
    if (entry->compressed)
        return fault("chunk '" + entry->type + "' is compressed twice", "make the file again");
    if (!has_bytes({entry->offset, std::min(head, entry->stored)}))
        return fault("chunk '" + entry->type + "' has not arrived yet", "load its beginning first");
    return bytes_.subspan(entry->offset, entry->stored);
}

Status ChunkReader::unpack(std::string_view type,
                           std::span<std::uint8_t> to,
                           JobRunner& jobs) const {
    const Entry& entry = *find(type);
    const auto stored = bytes_.subspan(entry.offset, entry.stored);
    const std::string name = "chunk '" + std::string(type) + "'";
    if (Status sum = check_sum(entry); !sum) return sum;
    if (!entry.compressed) {
        if (!to.empty()) std::memcpy(to.data(), stored.data(), to.size());
        return Done{};
    }
    struct Frame {
        std::size_t from, from_bytes, to, to_bytes;
    };
    std::vector<Frame> frames;
    for (std::size_t from = 0, filled = 0; from < stored.size() || filled < to.size();) {
        const std::size_t expected = std::min(kFrameBytes, to.size() - filled);
        const std::size_t n =
            ZSTD_findFrameCompressedSize(stored.data() + from, stored.size() - from);
        if (ZSTD_isError(n) || n == 0 || expected == 0 ||
            ZSTD_getFrameContentSize(stored.data() + from, stored.size() - from) != expected) {
            return fault(name + " holds a frame of the wrong size", "make the file again");
        }
        frames.push_back({from, n, filled, expected});
        from += n;
        filled += expected;
    }
    std::atomic<bool> good{true};
    jobs.run(frames.size(), [&](std::size_t i) {
        const Frame& f = frames[i];
        const std::size_t n =
            ZSTD_decompress(to.data() + f.to, f.to_bytes, stored.data() + f.from, f.from_bytes);
        if (n != f.to_bytes) good = false;
    });
    if (!good) return fault(name + " cannot be decompressed", "make the file again");
    return Done{};
}

std::vector<std::string> chunk_types(std::span<const std::uint8_t> bytes) {
    constexpr std::size_t kTypeBytes = 8;
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

Result<std::vector<std::uint8_t>> rearranged(std::span<const std::uint8_t> bytes,
                                             std::string_view kind,
                                             std::span<const std::string_view> order,
                                             int level,
                                             const std::string& where,
                                             JobRunner& jobs) {
    std::vector<std::string> types = chunk_types(bytes);
    const std::vector<std::string_view> known(types.begin(), types.end());
    SONOCASE_TRY(const auto reader, ChunkReader::open(bytes, kind, known, where));
    const auto rank = [&](const std::string& type) {
        return std::find(order.begin(), order.end(), type) - order.begin();
    };
    std::stable_sort(types.begin(), types.end(),
                     [&](const std::string& a, const std::string& b) { return rank(a) < rank(b); });
    ChunkWriter writer{std::string(kind)};
    for (const std::string& type : types) {
        if (reader.is_compressed(type)) {
            SONOCASE_TRY(auto raw, reader.read(type, reader.raw_bytes(type), jobs));
            writer.add(type, reader.is_required(type), std::move(raw));
        } else {
            SONOCASE_TRY(const auto packed, reader.packed(type));
            writer.add_packed(type, reader.is_required(type),
                              std::vector<std::uint8_t>(packed.begin(), packed.end()));
        }
    }
    return writer.write(jobs, level);
}

}  // namespace sonocase
