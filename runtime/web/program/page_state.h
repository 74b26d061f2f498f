// SPDX-License-Identifier: Apache-2.0

// What the functions that the page calls share: the page is single and so is its player.
// exports.cpp plays the part of main() and holds it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "runtime/web/page_player.h"

#define SONOCASE_EXPORT(name) extern "C" __attribute__((export_name(#name)))

namespace sonocase::runtime {

// Order of values(); page/core.js names them in the same order.
enum Value {
    kSide,
    kMmPerPx,
    kOriginX,
    kOriginY,
    kDepthMm,
    kFocusMm,
    kModelPaper,
    kHasNeedle,
    kNeedleDepthMm,
    kInContact,
    kPressMm,
    kKept,
    kAttempt,
    kSeconds,
    kInsertions,
    kTargetsHit,
    kTipToTargetMm,
    kTipInView,
    kInNoGo,
    kDamaged,
    kFrameNumber,
    kMissing,  // blocks
    kSegmentsLeft,
    kHasFlow,    // 0: says nothing of the flow of blood, or no Doppler mode was on
    kMachineHz,  // pictures per second of a machine with this colour box
    kSoundHz,
    kBeats,  // of the spectrum, that were measured; the next four are of them
    kPsv,
    kEdv,
    kResistiveIndex,
    kFlow,
    kValueCount
};

struct Page {
    RawVector<std::uint8_t> incoming;
    std::optional<Arrivals> arrivals;  // of incoming; the player's own once it is open
    std::vector<std::uint64_t> segment_hashes;
    std::vector<SegmentRun> runs;
    std::unique_ptr<PagePlayer> player, warming;
    ImageSettings settings;
    std::string text;
    std::vector<std::uint8_t> bytes;
    std::vector<std::uint32_t> screen;
    std::array<double, kValueCount> values{};
    std::array<double, 32> poses{};
    std::vector<double> numbers;  // of what was asked for last: targets, marks
    std::array<double, 16> doppler{};
};
extern Page page;

// 1, or 0 with the reason in text().
int answer(const Status& status);

}  // namespace sonocase::runtime
