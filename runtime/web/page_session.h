// SPDX-License-Identifier: Apache-2.0

// An attempt on a page: what SessionRun is to the window, kept in memory instead of a file.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/recording/session.h"
#include "formats/scoring/session_monitor.h"
#include "formats/scoring/session_score.h"
#include "runtime/engine/scan_engine.h"

namespace sonocase::runtime {

// The recording is what sonoplay writes (docs/format.md, part 7), complete even without a score.
struct FinishedSession {
    std::vector<std::uint8_t> recording;  // bytes of an .igs.mha
    SessionScore score;
    std::string score_json;  // as `sonoplay --stats` and `sonocase review` give it
};

class PageSession {
  public:
    // The bundle must outlive the session. seed: of the attempt; 0: as written.
    PageSession(const CaseBundle& bundle,
                const ScanEngine& engine,
                const std::string& trainee,
                const std::string& started,
                std::uint64_t seed = 0);

    // Another engine of the same exercise goes on.
    void use(const ScanEngine& engine) { anatomy_ = engine.anatomy(); }
    // Takes the frame that the engine just rendered.
    void observe(const FrameRecord& record);

    double seconds() const;
    const SessionMonitor& monitor() const { return monitor_; }
    const std::vector<std::string>& words() const { return words_; }  // the last six, newest last

    // The scores are those of the recording's bytes, read again as a replay would read them.
    Result<FinishedSession> finish() const;

  private:
    const CaseBundle& bundle_;
    Exercise exercise_;
    std::shared_ptr<const Anatomy> first_anatomy_, anatomy_;  // the monitor keeps the first
    SessionMonitor monitor_;
    Session session_;
    ImageSettings settings_;
    std::vector<std::string> words_;
};

}  // namespace sonocase::runtime
