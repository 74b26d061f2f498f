// SPDX-License-Identifier: Apache-2.0

// The part of a session's sample that a frame fills, wherever it is recorded: RecordedFrame on the
// desktop, SessionSample in a page.
#pragma once

#include "runtime/engine/scan_engine.h"

namespace sonocase::runtime {

// All but the settings' text. Does not allocate.
template <class Sample>
void fill_sample(const FrameRecord& record, Sample& sample) {
    sample.time_s = record.input.time_s;
    sample.frame = record.input.frame;
    sample.probe_ok = record.tools.has_probe;
    sample.needle_ok = record.tools.has_needle;
    sample.mannequin_from_probe = record.tools.mannequin_from_probe;
    sample.mannequin_from_needle = record.tools.mannequin_from_needle;
    sample.mannequin_from_drawn = record.needle.mannequin_from_drawn;
    sample.has_press = record.press.solved;
    sample.press = {record.press.force_n, record.press.pressure_kpa, record.press.vein_open};
}

}  // namespace sonocase::runtime
