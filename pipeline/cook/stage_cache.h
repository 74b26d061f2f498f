// Results of stages, kept under the hash of what they were made from.
//
// One file an entry, DIR/<stage>/<first two digits>/<key>; the key is the hash of the stage's name
// and version, its options and its inputs' digests. Entries are written under another name and
// renamed, so that many programs on many machines may share the folder: two that make the same
// entry write the same bytes. Every entry carries the digest of its bytes; one that does not match,
// is cut off or belongs to another key counts as absent and is written anew.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/result.h"

namespace sonocase::pipeline {

struct CacheEntry {
    std::vector<std::uint8_t> bytes;
    std::string digest;  // of bytes
    double seconds = 0;  // that the stage took when it ran
};

class StageCache {
  public:
    // An empty folder name makes a cache that holds nothing. limit_bytes bounds the folder: after a
    // store that passes it the entries not used for longest go, down to nine tenths. 0: no bound.
    explicit StageCache(std::string folder, std::uint64_t limit_bytes = 0);

    bool enabled() const { return !folder_.empty(); }
    // Finding an entry marks it as used. `damaged` (may be null) is set where one was there but
    // bad.
    std::optional<CacheEntry> find(const std::string& stage,
                                   const std::string& key,
                                   bool* damaged) const;
    Status store(const std::string& stage, const std::string& key, const CacheEntry& entry) const;

    std::string path_of(const std::string& stage, const std::string& key) const;

  private:
    void trim() const;
    std::string folder_;
    std::uint64_t limit_bytes_;
};

}  // namespace sonocase::pipeline
