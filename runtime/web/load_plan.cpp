// SPDX-License-Identifier: Apache-2.0

#include "runtime/web/load_plan.h"

#include <algorithm>
#include <utility>

namespace sonocase::runtime::inline web {
namespace {

// Segments between two runs that are fetched rather than asked for apart: a request costs as much.
constexpr std::uint32_t kBridge = 4;

class Chosen {
  public:
    Chosen(const Arrivals& arrivals, std::vector<std::uint8_t>& asked)
        : arrivals_(arrivals), asked_(asked) {}

    void add(std::size_t segment) {
        if (arrivals_.has_segment(segment) || asked_[segment]) return;
        asked_[segment] = 1;
        segments_.push_back(static_cast<std::uint32_t>(segment));
    }
    void add(ByteRange range) {
        if (range.count == 0) return;
        for (std::size_t n = range.at / arrivals_.segment_bytes();
             n * arrivals_.segment_bytes() < range.end(); ++n)
            add(n);
    }
    std::size_t size() const { return segments_.size(); }

    std::vector<SegmentRun> runs() {
        std::sort(segments_.begin(), segments_.end());
        std::vector<SegmentRun> out;
        for (const std::uint32_t segment : segments_) {
            if (!out.empty() && bridge(out.back(), segment)) continue;
            out.push_back({segment, 1});
        }
        return out;
    }

  private:
    // Lengthens the run to the segment if little lies between them, and nothing that is there.
    bool bridge(SegmentRun& run, std::uint32_t segment) {
        const std::uint32_t end = run.first + run.count;
        if (segment - end > kBridge) return false;
        for (std::uint32_t n = end; n < segment; ++n) {
            if (arrivals_.has_segment(n) || asked_[n]) return false;
        }
        for (std::uint32_t n = end; n < segment; ++n) asked_[n] = 1;
        run.count = segment + 1 - run.first;
        return true;
    }

    const Arrivals& arrivals_;
    std::vector<std::uint8_t>& asked_;
    std::vector<std::uint32_t> segments_;
};

}  // namespace

std::vector<SegmentRun> LoadPlan::next(const StreamedBundle& bundle,
                                       Point3 centre,
                                       std::size_t max_segments) {
    const Arrivals& arrivals = *bundle.arrivals();
    Chosen chosen(arrivals, asked_);
    const VoxelBlocks* blocks = bundle.blocks();
    const auto add_block = [&](std::size_t block) {
        for (const ByteRange& range : blocks->places(block)) chosen.add(range);
    };
    if (blocks != nullptr && blocks->awaited() > 0) {
        for (std::size_t block = 0; block < blocks->count(); ++block) {
            if (blocks->is_awaited(block)) add_block(block);
        }
        if (chosen.size() > 0) return chosen.runs();
    }
    if (blocks != nullptr) {
        const Point3 from = bundle->grid.voxel_from_point(centre);
        const double half = 0.5 * blocks->edge();
        std::vector<std::pair<double, std::size_t>> nearest;
        for (std::size_t block = 0; block < blocks->count(); ++block) {
            const Int3 lower = blocks->lower(block);
            const Vector3 way = Point3{lower.x + half, lower.y + half, lower.z + half} - from;
            nearest.emplace_back(dot(way, way), block);
        }
        std::sort(nearest.begin(), nearest.end());
        for (const auto& [unused, block] : nearest) {
            if (chosen.size() >= max_segments) break;
            add_block(block);
        }
    }
    for (std::size_t n = 0; n < arrivals.segments() && chosen.size() < max_segments; ++n)
        chosen.add(n);
    return chosen.runs();
}

void LoadPlan::ask_again(SegmentRun run) {
    for (std::uint32_t n = run.first; n < run.first + run.count; ++n) asked_[n] = 0;
}

}  // namespace sonocase::runtime::inline web
