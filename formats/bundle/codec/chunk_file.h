// SPDX-License-Identifier: Apache-2.0

// The container of case bundles and of the files between stages: a header, a table and chunks.
// docs/format.md, part 1. Little-endian. Every byte of a file is
// accounted for: header, table and chunks carry checksums, and padding is zero, so that any change
// to a file is found (except inside an optional chunk that is skipped).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "formats/base/arrivals.h"
#include "formats/base/jobs.h"
#include "formats/base/result.h"

namespace sonocase {

inline constexpr std::uint32_t kContainerVersion = 1;
inline constexpr std::size_t kChunkAlignment = 64;
inline constexpr std::size_t kMaxChunks = 4096;
inline constexpr std::size_t kFrameBytes = std::size_t{1} << 20;  // raw bytes of one zstd frame
inline constexpr int kChunkLevel = 6;                             // of zstd

// kind      four characters that say what the file is: "CASE", "LABL", "TXTR", "SURF"
// type      up to eight characters that say what a chunk is
// required  a reader that does not know the type must refuse the file
class ChunkWriter {
  public:
    explicit ChunkWriter(std::string kind);
    void add(std::string type, bool required, std::vector<std::uint8_t> bytes);
    // Borrows: the bytes must stay valid until write() returns.
    void add_view(std::string type, bool required, std::span<const std::uint8_t> bytes);
    // Bytes that are compressed already; readers take them as they are (ChunkReader::packed()).
    void add_packed(std::string type, bool required, std::vector<std::uint8_t> bytes);
    template <class T, class A>
    void add_array(const std::string& type, bool required, const std::vector<T, A>& values) {
        static_assert(std::is_trivially_copyable_v<T>);
        add_view(type, required,
                 {reinterpret_cast<const std::uint8_t*>(values.data()), values.size() * sizeof(T)});
    }
    // Chunks in the order added. The bytes do not depend on `jobs`. level: of zstd.
    std::vector<std::uint8_t> write(JobRunner& jobs = serial_jobs(), int level = kChunkLevel) const;

  private:
    struct Chunk {
        std::string type;
        bool required;
        std::vector<std::uint8_t> owned;
        std::span<const std::uint8_t> view;
        bool packed = false;
    };
    std::string kind_;
    std::vector<Chunk> chunks_;
};

// Reads from memory that must outlive the reader. open() checks header, table, order, padding and
// that every required chunk is one of `known`; a chunk's checksum is checked when it is read.
class ChunkReader {
  public:
    // bytes: # the whole file. arrivals: null for a whole file; otherwise which of its bytes have
    // arrived, and must outlive the reader. Reading a chunk of which bytes are missing is an error.
    static Result<ChunkReader> open(std::span<const std::uint8_t> bytes,
                                    std::string_view kind,
                                    std::span<const std::string_view> known,
                                    const std::string& where,
                                    const Arrivals* arrivals = nullptr);

    bool has(std::string_view type) const;
    bool is_compressed(std::string_view type) const;
    bool is_required(std::string_view type) const;
    ByteRange place(std::string_view type) const;  // empty if absent
    // True if all bytes of the chunk have arrived, or if there is no such chunk.
    bool is_loaded(std::string_view type) const;
    const Arrivals* arrivals() const { return arrivals_; }
    std::size_t raw_bytes(std::string_view type) const;  // 0 if absent
    // max_bytes: what the caller can use; more is an error before anything is allocated.
    Result<std::vector<std::uint8_t>> read(std::string_view type,
                                           std::size_t max_bytes,
                                           JobRunner& jobs = serial_jobs()) const;
    // The bytes of a chunk of add_packed() as they are in the file; their checksum is checked.
    Result<std::span<const std::uint8_t>> packed(std::string_view type) const;
    // The same for a chunk that may be incomplete: only its first `head` bytes must have arrived,
    // and its checksum is not checked.
    Result<std::span<const std::uint8_t>> packed_in_part(std::string_view type,
                                                         std::size_t head) const;
    // count: the number of values, which the chunk must hold exactly.
    template <class T, class Values = std::vector<T>>
    Result<Values> read_array(std::string_view type,
                              std::size_t count,
                              JobRunner& jobs = serial_jobs()) const {
        static_assert(std::is_trivially_copyable_v<T>);
        Values values;
        SONOCASE_TRY_DONE(check_size(type, count, sizeof(T)));
        values.resize(count);
        const std::span<std::uint8_t> to(reinterpret_cast<std::uint8_t*>(values.data()),
                                         count * sizeof(T));
        SONOCASE_TRY_DONE(unpack(type, to, jobs));
        return values;
    }
    const std::string& where() const { return where_; }
    Error fault(const std::string& what, const std::string& expected = "") const;

  private:
    struct Entry {
        std::string type;
        bool required = false;
        bool compressed = false;
        std::size_t offset = 0;
        std::size_t stored = 0;
        std::size_t raw = 0;
        std::uint64_t checksum = 0;
    };
    Status check_header(std::string_view kind) const;
    Result<Entry> read_entry(std::span<const std::uint8_t> raw,
                             std::size_t i,
                             std::size_t end) const;
    const Entry* find(std::string_view type) const;
    Status check_size(std::string_view type, std::size_t count, std::size_t bytes_each) const;
    Status check_sum(const Entry& entry) const;
    Status unpack(std::string_view type, std::span<std::uint8_t> to, JobRunner& jobs) const;

    bool has_bytes(ByteRange range) const { return arrivals_ == nullptr || arrivals_->has(range); }

    std::span<const std::uint8_t> bytes_;
    const Arrivals* arrivals_ = nullptr;
    std::vector<Entry> entries_;
    std::string where_;
};

// The types in the table of a file, which need not be valid; in its order.
std::vector<std::string> chunk_types(std::span<const std::uint8_t> file);

// The same chunks in another order: those of `order` first, the others after them as they were.
// Compressed chunks are compressed again at `level` of zstd. bytes: a whole file of this kind.
Result<std::vector<std::uint8_t>> rearranged(std::span<const std::uint8_t> bytes,
                                             std::string_view kind,
                                             std::span<const std::string_view> order,
                                             int level,
                                             const std::string& where,
                                             JobRunner& jobs = serial_jobs());

}  // namespace sonocase
