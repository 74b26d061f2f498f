// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/session_replay.h"

#include "formats/files/recording_file.h"

namespace sonocase::runtime {

std::optional<SessionReplay> session_replay(const std::string& path) {
    const auto sequence = load_sequence(path);
    if (!sequence || sequence->transform_index(kProbeTransform) < 0) return {};
    const auto session = session_from_sequence(*sequence, guess_names(*sequence), path);
    if (!session || session->header.program.empty()) return {};
    SessionReplay replay;
    replay.header = session->header;
    for (const SessionSample& sample : session->samples) {
        replay.settings.push_back(sample.settings);
        replay.times_s.push_back(sample.time_s - session->samples.front().time_s);
    }
    return replay;
}

}  // namespace sonocase::runtime
