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

// Fills sequence.pixels for its frames, which have their shape and number, in little-endian order.
// An error where the bytes are too few, or do not unpack to as many as the shape asks for.
Status read_sequence_pixels(std::span<const std::uint8_t> data,
                            const PixelCoding& coding,
                            const std::string& where,
                            Sequence& sequence);

}  // namespace sonocase::detail
