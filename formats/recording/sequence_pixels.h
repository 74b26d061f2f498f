// SPDX-License-Identifier: Apache-2.0

// The pixels of an IGSIO sequence as they follow its header. Internal to formats/recording.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "formats/base/result.h"
#include "formats/recording/sequence.h"

namespace sonocase::detail {

struct PixelCoding {
    bool compressed = false;  // a zlib or gzip stream
    bool big_endian = false;
    double compressed_bytes = -1;  // length of the stream; negative: to the end of the file
};

// Fills sequence.pixels, little-endian, for the number and shape of frames that `sequence` already
// has. An error when the bytes are too few, or do not unpack to exactly that size.
Status read_sequence_pixels(std::span<const std::uint8_t> data,
                            const PixelCoding& coding,
                            const std::string& where,
                            Sequence& sequence);

}  // namespace sonocase::detail
