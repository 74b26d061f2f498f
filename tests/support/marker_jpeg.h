// SPDX-License-Identifier: Apache-2.0

// Grey pictures as JPEG, as a camera compresses them, and a video of them (AVI, MJPG).
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include <jpeglib.h>

namespace sonocase::testing {

inline std::vector<std::uint8_t> jpeg_of(const std::vector<std::uint8_t>& grey,
                                         int width,
                                         int height,
                                         int quality) {
    jpeg_compress_struct to{};
    jpeg_error_mgr errors{};
    to.err = jpeg_std_error(&errors);
    jpeg_create_compress(&to);
    unsigned char* bytes = nullptr;
    unsigned long size = 0;
    jpeg_mem_dest(&to, &bytes, &size);
    to.image_width = static_cast<JDIMENSION>(width);
    to.image_height = static_cast<JDIMENSION>(height);
    to.input_components = 1;
    to.in_color_space = JCS_GRAYSCALE;
    jpeg_set_defaults(&to);
    jpeg_set_quality(&to, quality, TRUE);
    jpeg_start_compress(&to, TRUE);
    for (int y = 0; y < height; ++y) {
        JSAMPROW row = const_cast<JSAMPROW>(grey.data() + static_cast<std::size_t>(y) * width);
        jpeg_write_scanlines(&to, &row, 1);
    }
    jpeg_finish_compress(&to);
    jpeg_destroy_compress(&to);
    std::vector<std::uint8_t> out(bytes, bytes + size);
    std::free(bytes);
    return out;
}

inline std::vector<std::uint8_t> grey_of_jpeg(const std::vector<std::uint8_t>& jpeg) {
    jpeg_decompress_struct from{};
    jpeg_error_mgr errors{};
    from.err = jpeg_std_error(&errors);
    jpeg_create_decompress(&from);
    jpeg_mem_src(&from, jpeg.data(), jpeg.size());
    jpeg_read_header(&from, TRUE);
    from.out_color_space = JCS_GRAYSCALE;
    jpeg_start_decompress(&from);
    std::vector<std::uint8_t> out(static_cast<std::size_t>(from.output_width) * from.output_height);
    while (from.output_scanline < from.output_height) {
        JSAMPROW row =
            out.data() + static_cast<std::size_t>(from.output_scanline) * from.output_width;
        jpeg_read_scanlines(&from, &row, 1);
    }
    jpeg_finish_decompress(&from);
    jpeg_destroy_decompress(&from);
    return out;
}

inline std::vector<std::uint8_t> through_jpeg(const std::vector<std::uint8_t>& grey,
                                              int width,
                                              int height,
                                              int quality) {
    return grey_of_jpeg(jpeg_of(grey, width, height, quality));
}

// An AVI of one stream of JPEG pictures, as small as the format allows.
inline std::string avi_of(const std::vector<std::vector<std::uint8_t>>& jpegs,
                          int width,
                          int height,
                          double rate_hz) {
    const auto u32 = [](std::uint32_t v) {
        std::string s(4, '\0');
        for (int k = 0; k < 4; ++k) s[k] = static_cast<char>(v >> (8 * k));
        return s;
    };
    const auto u16 = [](std::uint32_t v) {
        return std::string{static_cast<char>(v), static_cast<char>(v >> 8)};
    };
    const auto chunk = [&](const char* name, const std::string& body) {
        return name + u32(static_cast<std::uint32_t>(body.size())) + body +
               (body.size() % 2 ? std::string(1, '\0') : "");
    };
    const auto w = static_cast<std::uint32_t>(width), h = static_cast<std::uint32_t>(height);
    const auto count = static_cast<std::uint32_t>(jpegs.size());
    const auto period_us = static_cast<std::uint32_t>(1e6 / rate_hz + 0.5);
    const std::string avih = u32(period_us) + u32(0) + u32(0) + u32(0) + u32(count) + u32(0) +
                             u32(1) + u32(0) + u32(w) + u32(h) + std::string(16, '\0');
    const std::string strh = std::string("vidsMJPG") + u32(0) + u32(0) + u32(0) + u32(period_us) +
                             u32(1000000) + u32(0) + u32(count) + u32(0) + u32(0xFFFFFFFF) +
                             u32(0) + u16(0) + u16(0) + u16(w) + u16(h);
    const std::string strf = u32(40) + u32(w) + u32(h) + u16(1) + u16(24) + "MJPG" +
                             u32(w * h * 3) + std::string(16, '\0');
    std::string movi = "movi";
    for (const auto& jpeg : jpegs) movi += chunk("00dc", std::string(jpeg.begin(), jpeg.end()));
    const std::string strl = chunk("LIST", "strl" + chunk("strh", strh) + chunk("strf", strf));
    const std::string hdrl = chunk("LIST", "hdrl" + chunk("avih", avih) + strl);
    return chunk("RIFF", "AVI " + hdrl + chunk("LIST", movi));
}

}  // namespace sonocase::testing
