// SPDX-License-Identifier: Apache-2.0

// Keeps results of stages under the hash of what they were made from.
//
// Each entry is one file, DIR/<stage>/<first two digits>/<key>; the key is the hash of the stage's
// name and version, its options and its inputs' digests. Entries are written under another name and
// renamed, so that many programs on many machines may share the folder: two that make the same
// entry write the same bytes, and a program that has an entry open can read on when it is removed.
// Every entry carries the digest of its bytes; one that does not match, is cut off or belongs to
// another key counts as absent and is written again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::pipeline::inline stages {

struct CacheEntry {
    std::vector<std::uint8_t> bytes;
    std::string digest;  // of bytes
    double seconds = 0;  // taken by the stage when it ran
};

// What tidy found and did.
struct CacheSummary {
    std::size_t entries = 0;    // remaining
    std::uint64_t bytes = 0;    // of the remaining entries
    std::size_t evicted = 0;    // removed for the limit
    std::size_t old = 0;        // removed, since nobody used them for long
    std::size_t damaged = 0;    // removed; only with `verify`
    std::size_t leftovers = 0;  // files of killed writers, removed
};

class StageCache {
  public:
    // An empty folder name makes a cache that holds nothing. limit_bytes bounds the folder: when a
    // store exceeds it, the entries not used for longest are removed, down to nine tenths of it.
    // 0: no bound.
    explicit StageCache(std::string folder, std::uint64_t limit_bytes = 0);

    bool enabled() const { return !folder_.empty(); }
    // Finding an entry marks it as used. `damaged` (may be null) is set if there was an
    // entry and it was damaged.
    std::optional<CacheEntry> find(const std::string& stage,
                                   const std::string& key,
                                   bool* damaged) const;
    // The digest of an entry's bytes from its first line, which has a checksum of its own; the
    // bytes are not read, only counted. Marks the entry as used.
    std::optional<std::string> digest_in(const std::string& stage, const std::string& key) const;
    Status store(const std::string& stage, const std::string& key, const CacheEntry& entry) const;

    // Removes leftovers, with `verify` also damaged entries, entries that were not used for
    // longest_days (0: any time), and what passes the limit.
    CacheSummary tidy(bool verify, double longest_days = 0) const;

    std::string path_of(const std::string& stage, const std::string& key) const;

  private:
    CacheSummary trim() const;
    std::string folder_;
    std::uint64_t limit_bytes_;
};

}  // namespace sonocase::pipeline::inline stages
