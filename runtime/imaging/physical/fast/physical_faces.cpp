// SPDX-License-Identifier: Apache-2.0

// Effects diaphragm and gas_ring_down: where a frame's beams meet gas.
#include <algorithm>

#include "runtime/imaging/physical/fast/physical_fast.h"

namespace sonocase::runtime {

using namespace physical;

void PhysicalFast::find_faces(const PhysicalFrame& f, const BreathingField* breathing) {
    faces_.any_dome = false;
    faces_found_ = scene_.has_gas && (f.effects.diaphragm || f.effects.gas_ring_down);
    if (!faces_found_) return;
    const int nodes = static_cast<int>(face_nodes_.size());
    context_.workers.for_each((nodes + kFaceEvery - 1) / kFaceEvery, [&](int, int part) {
        for (int n = part * kFaceEvery; n < std::min((part + 1) * kFaceEvery, nodes); ++n) {
            const int line = std::min(n * kFaceEvery, geometry_.scanlines - 1);
            face_nodes_[static_cast<std::size_t>(n)] =
                find_face(scene_, geometry_, f, breathing,
                          static_cast<double>(gaps_[static_cast<std::size_t>(line)]), line);
            if (!f.effects.diaphragm) face_nodes_[static_cast<std::size_t>(n)].peak = 0;
        }
    });
    join_faces(geometry_, face_nodes_, faces_);
}

// line: of the block's first beam.
void PhysicalFast::show_faces(int line, PhysicalBlock& b) const {
    if (!faces_found_) return;
    b.face_mm = faces_.depth_mm.data() + line;
    b.face_peak = faces_.peak.data() + line;
    b.cosine = faces_.cosine.data() + line;
    if (!faces_.any_dome) return;
    const float* dome = faces_.dome_mm.data() + line;
    if (std::all_of(dome, dome + kBeamBlock, [](float mm) { return mm >= kNoFace; })) return;
    b.dome_mm = dome;
    b.dome_scale = static_cast<float>(tables_.dome_scale);
}

}  // namespace sonocase::runtime
