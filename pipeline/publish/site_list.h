// SPDX-License-Identifier: Apache-2.0

// The list of a site's cases, cases.json (docs/browser.md).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::pipeline {

inline constexpr std::size_t kSegmentBytes = std::size_t{64} << 10;

struct SiteCase {
    std::string name;   // letters, digits, - and _; of the address
    std::string title;  // shown
    std::string file;   // "NAME-DIGITS.sonocase": another content has another name
    std::uint64_t bytes = 0;
    std::string digest;                 // XXH3-128 of all bytes
    std::vector<std::string> segments;  // XXH3-128 of each kSegmentBytes, the last one shorter
    std::vector<std::uint8_t> preview;  // PNG; may be empty
    struct Entry {
        std::string name, title, description;
    };
    std::vector<Entry> exercises;
};

// path: of the bundle whose bytes these are. Errors: bytes that are not a bundle.
Result<SiteCase> site_case(std::span<const std::uint8_t> bytes, const std::string& path);

std::string site_list_json(const std::vector<SiteCase>& cases, const std::string& xapi);

}  // namespace sonocase::pipeline
