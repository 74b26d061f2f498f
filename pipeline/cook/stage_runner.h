// SPDX-License-Identifier: Apache-2.0

// Runs the stages of a case one after the other, each through the cache, and keeps their reports.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "formats/base/digest.h"
#include "pipeline/cook/cook_case.h"
#include "pipeline/cook/stage_cache.h"
#include "pipeline/cook/stage_keys.h"

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

// A stage's answer as it goes from stage to stage. `digest` stands for it in later keys; empty
// without a cache. The answer itself may still lie in the cache and is read when it is asked for.
template <class Codec>
class Made {
  public:
    using Value = typename Codec::Value;
    std::string digest;

    Result<Value*> get() {
        if (!value_) {
            auto loaded = load_();
            if (!loaded) return loaded.error();
            value_ = std::move(*loaded);
        }
        return &*value_;
    }
    // Frees the memory; get() would read it again.
    void drop() { value_.reset(); }

  private:
    friend class StageRunner;
    std::optional<Value> value_;
    std::function<Result<Value>()> load_;
};

class StageRunner {
  public:
    // until  the stage that is wanted, all before it only as far as it needs them; empty: all
    StageRunner(const CookOptions& options, const Progress& progress)
        : cache_(options.cache_folder, options.cache_bytes),
          until_(options.until),
          progress_(progress) {}

    std::vector<StageRun> runs;  // of the answers that are there, in order

    bool wants(const std::string& stage) const { return whole() || stage == until_; }
    bool whole() const { return until_.empty() || until_ == "pack"; }

    // The answer of `stage` from the cache, or made by `make` and stored. `others` holds the
    // digests of the answers that it takes. A stage that is not wanted itself is only looked up;
    // `make` and what it refers to must live as long as the answer. The codec's encode must not
    // depend on seconds; its reports() gives the reports in the answer, whose seconds are then
    // filled in.
    template <class Codec, class Make>
    Result<Made<Codec>> run(const PlannedStage& stage,
                            const std::vector<std::string>& others,
                            double share,
                            const Make& make) {
        const double begin = done_;
        done_ += share;
        const std::string key = cache_.enabled() ? key_of(stage, others) : "";
        Made<Codec> made;
        if (!wants(stage.stage))
            if (auto digest = cache_.digest_in(stage.stage, key)) {
                made.digest = *digest;
                made.load_ = [this, name = stage.stage, key, begin, share, make,
                              promised = *digest] {
                    return load<Codec>(name, key, promised, begin, share, make);
                };
                return made;
            }
        std::string digest;
        auto value = obtain<Codec>(stage.stage, key, begin, share, make, &digest);
        if (!value) return value.error();
        made.value_ = std::move(*value);
        made.digest = digest;
        made.load_ = [this, name = stage.stage, key, begin, share, make, digest] {
            return load<Codec>(name, key, digest, begin, share, make);
        };
        return made;
    }

  private:
    static std::string key_of(const PlannedStage& stage, const std::vector<std::string>& others) {
        Digest digest;
        digest.add(std::string_view("sonocase stage")).add(std::string_view(stage.stage));
        digest.add(std::int64_t{stage.version});
        for (const auto* texts : {&stage.own, &others})
            for (const std::string& text : *texts) digest.add(std::string_view(text));
        return digest.hex();
    }

    template <class Codec, class Make>
    Result<typename Codec::Value> obtain(const std::string& stage,
                                         const std::string& key,
                                         double begin,
                                         double share,
                                         const Make& make,
                                         std::string* digest) {
        using Value = typename Codec::Value;
        const Progress part = [this, begin, share](double fraction, std::string_view doing) {
            report_progress(progress_, begin + share * fraction, doing);
        };
        part(0, stage);
        bool damaged = false;
        if (auto entry = cache_.find(stage, key, &damaged)) {
            auto value = Codec::decode(entry->bytes, cache_.path_of(stage, key));
            if (value) {
                keep(Codec::reports(*value), entry->seconds, key, true);
                *digest = entry->digest;
                return value;
            }
            damaged = true;
        }
        const StageClock clock;
        Result<Value> value = make(part);
        if (!value) return value.error();
        const double seconds = clock.seconds();
        std::string note;
        if (cache_.enabled()) {
            CacheEntry entry{Codec::encode(*value), "", seconds};
            *digest = entry.digest = digest_of(entry.bytes);
            if (auto status = cache_.store(stage, key, entry); !status)
                note = "the cache could not be written (" + status.error().message() + ")";
        }
        keep(Codec::reports(*value), seconds, key, false);
        if (damaged) runs.back().report.warnings.push_back("a damaged cache entry was made anew");
        if (!note.empty()) runs.back().report.warnings.push_back(note);
        return value;
    }

    // The answer whose digest has gone into later keys already.
    template <class Codec, class Make>
    Result<typename Codec::Value> load(const std::string& stage,
                                       const std::string& key,
                                       const std::string& promised,
                                       double begin,
                                       double share,
                                       const Make& make) {
        std::string digest;
        auto value = obtain<Codec>(stage, key, begin, share, make, &digest);
        if (value && digest != promised)
            return Error{"stage " + stage + " gives another answer than the cache held",
                         cache_.path_of(stage, key),
                         "run again; if it comes back, the stage's version was not raised"};
        return value;
    }

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
    std::string until_;
    const Progress& progress_;
    double done_ = 0;
};

}  // namespace sonocase::pipeline
