// Runs the stages of a case one after the other, each through the cache, and keeps their reports.
#pragma once

#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "formats/digest.h"
#include "pipeline/cook/cook_case.h"
#include "pipeline/cook/stage_cache.h"

namespace sonocase::pipeline {

// Seconds since it was made.
class StageClock {
  public:
    double seconds() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    }

  private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// A stage's answer as it goes from stage to stage. `digest` stands for the answer in later keys;
// empty without a cache.
template <class T>
struct Made {
    T value;
    std::string digest;
};

// Runs the stages one after the other and keeps their reports.
class StageRunner {
  public:
    StageRunner(const CookOptions& options, const Progress& progress)
        : cache_(options.cache_folder, options.cache_bytes), progress_(progress) {}

    std::vector<StageRun> runs;  // in order

    // The answer of `stage` from the cache, or made by `make` and stored. `inputs` holds whatever
    // the answer depends on. The codec's encode must not depend on seconds; its reports() gives the
    // reports in the answer, whose seconds are then filled in.
    template <class Codec, class Make>
    auto run(const std::string& stage,
             int version,
             std::vector<std::string> inputs,
             double share,
             const Make& make) -> Result<Made<typename Codec::Value>> {
        using Value = typename Codec::Value;
        const double begin = done_;
        const Progress part = [this, begin, share](double fraction, std::string_view doing) {
            tell(progress_, begin + share * fraction, doing);
        };
        part(0, stage);
        done_ += share;
        std::string key;
        bool damaged = false;
        if (cache_.enabled()) {
            Digest digest;
            digest.add(std::string_view("sonocase stage")).add(std::string_view(stage));
            digest.add(std::int64_t{version});
            for (const std::string& input : inputs) digest.add(std::string_view(input));
            key = digest.hex();
            if (auto entry = cache_.find(stage, key, &damaged)) {
                auto value = Codec::decode(entry->bytes, cache_.path_of(stage, key));
                if (value) {
                    keep(Codec::reports(*value), entry->seconds, key, true);
                    return Made<Value>{std::move(*value), entry->digest};
                }
                damaged = true;
            }
        }
        const StageClock clock;
        Result<Value> value = make(part);
        if (!value) return value.error();
        const double seconds = clock.seconds();
        std::string digest;
        if (cache_.enabled()) {
            CacheEntry entry{Codec::encode(*value), "", seconds};
            digest = entry.digest = digest_of(entry.bytes);
            if (auto status = cache_.store(stage, key, entry); !status)
                note_ = "the cache could not be written (" + status.error().message() + ")";
        }
        keep(Codec::reports(*value), seconds, key, false);
        if (damaged) runs.back().report.warnings.push_back("a damaged cache entry was made anew");
        if (!note_.empty()) runs.back().report.warnings.push_back(std::exchange(note_, {}));
        return Made<Value>{std::move(*value), digest};
    }

  private:
    void keep(const std::vector<StageReport>& reports,
              double seconds,
              const std::string& key,
              bool cached) {
        // A stage of several parts (align, warp) knows its parts' shares itself when it ran just
        // now; from the cache, whose entries hold no seconds, the first part carries the sum.
        double known = 0;
        for (const StageReport& report : reports) known += report.seconds;
        for (std::size_t i = 0; i < reports.size(); ++i) {
            StageRun run{reports[i], key, cached};
            if (known <= 0) run.report.seconds = i == 0 ? seconds : 0;
            runs.push_back(std::move(run));
        }
    }

    StageCache cache_;
    const Progress& progress_;
    double done_ = 0;
    std::string note_;
};

}  // namespace sonocase::pipeline
