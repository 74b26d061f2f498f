// SPDX-License-Identifier: Apache-2.0

// The list of a site's cases, cases.json (docs/browser.md).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/arrivals.h"
#include "formats/base/result.h"

namespace sonocase::pipeline {

// A page fetches a case in runs of segments. Smaller ones fetch less beside what a picture needs,
// and make the list of hashes longer.
inline constexpr std::size_t kSegmentBytes = std::size_t{4} << 10;

struct SiteCase {
    std::string name;   // letters, digits, - and _; of the address
    std::string title;  // shown
    std::string file;   // "NAME-DIGITS.sonocase": another content has another name
    std::uint64_t bytes = 0;
    std::string digest;                   // XXH3-128 of all bytes
    std::vector<std::uint64_t> segments;  // XXH3-64 of each kSegmentBytes, the last one shorter
    std::vector<ByteRange> first;         // what must be there before the case can be opened
    std::vector<std::uint8_t> preview;    // PNG; may be empty
    struct Entry {
        std::string name, title, description;
    };
    std::vector<Entry> exercises;
};

struct ReadCase {
    SiteCase site;
    std::vector<std::uint8_t> bytes;  // of the site's file
};

// path: of the bundle whose bytes these are. The site's file has the same chunks in the order in
// which a page loads them (arranged_for_loading()). Errors: bytes that are not a bundle.
Result<ReadCase> site_case(std::span<const std::uint8_t> bytes, const std::string& path);

// Little-endian, eight bytes per segment.
std::vector<std::uint8_t> segment_list(const SiteCase& site);

std::string site_list_json(const std::vector<SiteCase>& cases, const std::string& xapi);

}  // namespace sonocase::pipeline
