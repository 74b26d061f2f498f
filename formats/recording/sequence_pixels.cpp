// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/sequence_pixels.h"

#include <zlib.h>

#include <algorithm>

#include "formats/base/memory.h"
#include "formats/recording/sequence_header.h"

namespace sonocase::detail {
namespace {

// Unpacks `data` into `out`; false unless the stream is whole and fills it exactly.
bool inflate_exactly(std::span<const std::uint8_t> data, std::span<std::uint8_t> out) {
    z_stream stream{};
    if (inflateInit2(&stream, 15 + 32) != Z_OK) return false;
    std::size_t taken = 0, filled = 0;
    int state = Z_OK;
    while (state == Z_OK) {
        const std::size_t in = std::min<std::size_t>(data.size() - taken, 1u << 30);
        const std::size_t room = std::min<std::size_t>(out.size() - filled, 1u << 30);
        std::uint8_t beyond = 0;  // a stream that is longer than promised writes here
        stream.next_in = const_cast<Bytef*>(data.data() + taken);
        stream.avail_in = static_cast<uInt>(in);
        stream.next_out = room ? out.data() + filled : &beyond;
        stream.avail_out = room ? static_cast<uInt>(room) : 1;
        state = inflate(&stream, Z_NO_FLUSH);
        taken += in - stream.avail_in;
        const bool overflows = room == 0 && stream.avail_out == 0;
        if (room) filled += room - stream.avail_out;
        if (overflows || (state == Z_OK && taken == data.size() && stream.avail_out != 0)) break;
    }
    inflateEnd(&stream);
    return state == Z_STREAM_END && filled == out.size();
}

void swap_byte_order(std::vector<std::uint8_t>& pixels, std::size_t bytes_each) {
    for (std::size_t i = 0; i + bytes_each <= pixels.size(); i += bytes_each) {
        std::reverse(pixels.begin() + static_cast<std::ptrdiff_t>(i),
                     pixels.begin() + static_cast<std::ptrdiff_t>(i + bytes_each));
    }
}

}  // namespace

Status read_sequence_pixels(std::span<const std::uint8_t> data,
                            const PixelCoding& coding,
                            const std::string& where,
                            Sequence& sequence) {
    const std::size_t needed = sequence.frames.size() * sequence.frame_bytes();
    if (!coding.compressed) {
        if (data.size() < needed) {
            return sequence_fault(where,
                                  "holds " + std::to_string(data.size()) + " of " +
                                      std::to_string(needed) + " pixel bytes",
                                  "the file was cut short");
        }
        sequence.pixels.assign(data.begin(), data.begin() + static_cast<std::ptrdiff_t>(needed));
    } else {
        if (coding.compressed_bytes >= 0 &&
            coding.compressed_bytes < static_cast<double>(data.size())) {
            data = data.first(static_cast<std::size_t>(coding.compressed_bytes));
        }
        // Deflate shrinks by a factor of 1032 at most: a larger claim would only cost memory.
        if (needed / 1033 > data.size())
            return sequence_fault(where, "claims more pixels than its compressed bytes can hold");
        if (!can_allocate(needed))
            return sequence_fault(where, "needs more memory than is available");
        sequence.pixels.resize(needed);
        if (!inflate_exactly(data, sequence.pixels))
            return sequence_fault(where, "its compressed pixels do not unpack");
    }
    const std::size_t bytes_each =
        sequence.frame_bytes() /
        (static_cast<std::size_t>(sequence.width) * static_cast<std::size_t>(sequence.height) *
         static_cast<std::size_t>(sequence.depth) * static_cast<std::size_t>(sequence.channels));
    if (coding.big_endian && bytes_each > 1) swap_byte_order(sequence.pixels, bytes_each);
    return Done{};
}

}  // namespace sonocase::detail
