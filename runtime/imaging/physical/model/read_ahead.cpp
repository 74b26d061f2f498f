// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/read_ahead.h"

#include <utility>

namespace sonocase::runtime {
namespace {

// How far around the plane, after what the frame reads, nearest first. The last is how far a probe
// comes in a third of a second when it slides at 100 mm/s, or turns at 40 degrees/s and shows 150
// mm of depth.
constexpr double kAheadMm[] = {0, 8, 20, 35};

// A bundle that unpacks to more than this is read no further than the first step: all of it would
// end up in memory, and a frame needs little of it.
constexpr std::size_t kSmallBytes = std::size_t{200} << 20;

}  // namespace

ReadAhead::ReadAhead(VoxelBlocks& blocks, const Grid& grid, std::unique_ptr<Background> background)
    : blocks_(blocks), grid_(grid), background_(std::move(background)) {
    background_->start([](void* self) { static_cast<ReadAhead*>(self)->read(); }, this);
}

ReadAhead::~ReadAhead() {
    stop_ = true;
    background_->stop();
}

void ReadAhead::frame(const ScanReach& reach,
                      const Rigid& volume_from_probe,
                      double shift_mm) noexcept {
    if (blocks_.whole()) return;
    frames_.publish({&reach, volume_from_probe, shift_mm});
    news_ = true;
    background_->wake();
}

void ReadAhead::read() noexcept {
    news_ = false;  // before the frame is taken: one that comes later ends this call
    frames_.refresh();
    const Frame& frame = frames_.value();
    if (frame.reach == nullptr) return;
    for (const double ahead_mm : kAheadMm) {
        if (ahead_mm > kAheadMm[1] && blocks_.pool_bytes() > kSmallBytes) break;
        frame.reach->ensure_loaded_backwards(blocks_, grid_, frame.volume_from_probe,
                                             frame.shift_mm + ahead_mm,
                                             [this] { return news_ || stop_; });
    }
}

}  // namespace sonocase::runtime
