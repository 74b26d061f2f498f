// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/fast/physical_fast.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "runtime/imaging/host/pass_timer.h"
#include "runtime/imaging/scan/scan_convert.h"

namespace sonocase::runtime {
using namespace physical;

namespace {

constexpr int kSlack = kRowSlack, kMargin = kRowMargin;

std::int32_t pack_look(const AcousticProperties& look, double frequency_mhz) {
    const double loss = look.attenuation * frequency_mhz * 0.1 * 2 / kDbPerLog2;
    const auto attenuation =
        static_cast<std::uint32_t>(std::lround(std::clamp(loss * 4096, 0.0, 65535.0)));
    const auto echo =
        static_cast<std::int32_t>(std::lround(std::clamp(look.echo_db * 16, -2047.0, 2047.0)));
    const std::uint32_t kind = look.kind == TissueKind::outside ? kPackedOutside
                               : look.kind == TissueKind::fluid ? kPackedFluid
                               : look.kind == TissueKind::gas   ? kPackedGas
                               : look.kind == TissueKind::bone  ? kPackedBone
                                                                : kPackedSoft;
    return static_cast<std::int32_t>(attenuation | kind << 16 |
                                     static_cast<std::uint32_t>(echo) << 20);
}

std::int32_t pack_pair(const PairEcho& p, double sigma_mm) {
    std::int32_t word = 0;
    if (p.amplitude > 0)
        word = static_cast<std::int32_t>(
            std::lround(std::clamp(std::log2(p.amplitude) * 128 + 2048, 1.0, 4095.0)));
    word |= static_cast<std::int32_t>(std::lround(std::clamp(32 / sigma_mm, 1.0, 255.0))) << 12;
    word |= static_cast<std::int32_t>(std::lround(std::clamp(128 * p.split_mm, 0.0, 127.0))) << 24;
    if (p.hard) word |= kPairHard;
    if (p.refracts) word |= kPairRefracts;
    if (p.pulse > 0) word |= kPairOwnPulse;
    if (p.pulse < 0) word |= kPairSecondPulse;
    return word;
}

PhysicalRegion region_tables(const RegionLookUp& from) {
    PhysicalRegion out;
    if (from.region == nullptr) return out;
    const auto words = [](const auto& values) {
        return reinterpret_cast<const std::int32_t*>(values.data());
    };
    out.table = reinterpret_cast<const std::int32_t*>(from.words.data());
    out.labels = words(from.region->label_bricks.pool);
    if (from.words.has_boundary()) out.boundary = words(from.region->boundary.pool);
    out.size = from.region->grid.size;
    const Int3 blocks = from.words.blocks();
    out.blocks_x = blocks.x;
    out.blocks_xy = blocks.x * blocks.y;
    out.block_log2 = from.words.edge_log2();
    for (int axis = 0; axis < 3; ++axis) {
        out.lower[axis] = static_cast<float>(from.place.lower_vx[axis]);
        out.upper[axis] = static_cast<float>(from.place.upper_vx[axis]);
        out.first[axis] = static_cast<float>(from.place.first[axis]);
    }
    out.per_voxel = static_cast<float>(from.place.per_voxel);
    out.voxel_size = static_cast<float>(1 / from.place.per_voxel);
    out.step_mm = static_cast<float>(from.region->grid.spacing_mm.x / 48);
    return out;
}

}  // namespace

PhysicalFast::PhysicalFast(const PhysicalScene& scene,
                           const ScanGeometry& geometry,
                           const Tables& tables,
                           const PhysicalNoise& noise,
                           const press::PressFace& face,
                           const RenderContext& context)
    : scene_(scene),
      geometry_(geometry),
      tables_(tables),
      noise_(noise),
      context_(context),
      press_(geometry_, face),
      region_(region_tables(scene.region)) {
    const auto samples = static_cast<std::size_t>(geometry.samples);
    lines_ = (geometry.scanlines + kBeamBlock - 1) / kBeamBlock * kBeamBlock;
    stride_ = kMargin + lines_ + kMargin + kSlack;
    pair_stride_ = (lines_ + kSlack - 1) / kSlack * kSlack;
    cells_k_ = (geometry.samples + kHazeCell - 1) / kHazeCell;
    cells_l_ = (geometry.scanlines + kHazeCell - 1) / kHazeCell;
    conversion_ = make_scan_conversion_table(context.jobs, geometry, pair_stride_);
    conversion_.offset.resize(conversion_.offset.size() + kSlack);
    conversion_.weight.resize(conversion_.weight.size() + kSlack);

    for (const AcousticProperties& look : scene.looks)
        looks_.push_back(pack_look(look, tables.frequency_mhz));
    looks_.resize(256, 0);
    looks_wall_ = looks_;
    for (std::size_t l = 0; l < scene.looks.size(); ++l) {
        AcousticProperties look = scene.looks[l];
        look.echo_db += look.wall_db;
        looks_wall_[l] = pack_look(look, tables.frequency_mhz);
    }
    dim_off_.assign(256, 1.0f);
    for (const std::int32_t look : looks_)
        dim_.push_back(static_cast<float>(std::exp2(-(look & 0xFFFF) / 4096.0 * geometry.step_mm)));
    fine_frames_.assign(kFineNumbers * 256, 0.0f);
    for (std::size_t l = 0; l < scene.fine.frames.size() && l < 256; ++l) {
        const FineFrame& frame = scene.fine.frames[l];
        if (frame.cube < 0) continue;
        looks_[l] |= kLookFine;
        looks_wall_[l] |= kLookFine;
        std::copy(frame.cube_from_voxel.begin(), frame.cube_from_voxel.end(),
                  fine_frames_.begin() + static_cast<std::ptrdiff_t>(kFineNumbers * l));
        fine_frames_[kFineNumbers * l + 9] =
            static_cast<float>(frame.cube * kFineEdge * kFineEdge * kFineEdge);
        fine_frames_[kFineNumbers * l + 10] = static_cast<float>(kFineLayers[frame.cube] - 1);
    }
    for (const double most : scene.structure_most_db)
        structure_most_.push_back(static_cast<std::int32_t>(std::lround(16 * most)));
    if (!structure_most_.empty()) structure_most_.resize(256, 0);
    for (const double dead : scene.structure_dead_db)
        structure_dead_.push_back(static_cast<std::int32_t>(std::lround(16 * dead)));
    if (!structure_dead_.empty()) structure_dead_.resize(256, 0);
    for (const TargetBall& t : scene.targets) {
        const auto shape = [&](int row, int column) {
            return static_cast<float>(t.shape(row, column));
        };
        targets_.push_back(
            {static_cast<float>(t.centre_vx.x),
             static_cast<float>(t.centre_vx.y),
             static_cast<float>(t.centre_vx.z),
             static_cast<float>(t.radius_mm),
             static_cast<float>(t.reach_mm),
             t.round,
             {shape(0, 0), shape(1, 1), shape(2, 2), shape(0, 1), shape(0, 2), shape(1, 2)},
             t.look,
             static_cast<float>(t.wall),
             t.fluid});
    }
    frame_looks_ = looks_;
    near_targets_.reserve(targets_.size());
    for (const PairEcho& pair : scene.pairs)
        pairs_word_.push_back(pack_pair(pair, blurred_mm(tables, pair.sigma_mm)));
    for (const Row& row : tables.rows) {
        r_.push_back(static_cast<float>(row.r_mm));
        contact_.push_back(static_cast<float>(row.contact));
        elevation_.push_back(static_cast<float>(row.label_mm / 32));
        interface_scale_.push_back(static_cast<float>(row.interface_scale));
        gain_.push_back(static_cast<float>(row.gain));
        per_spacing_.push_back(static_cast<float>(tables.cell_mm / row.spacing_mm));
        speckle_level_.push_back(static_cast<float>(row.speckle));
        looks_drawn_.push_back(row.looks_drawn);
    }
    elevation_off_.assign(samples, 0.0f);
    per_spacing_thin_.assign(samples, 1.0f);
    speckle_level_bare_.assign(samples, static_cast<float>(kBareSpeckle));
    for (auto* starts : {&elevation_start_, &lookup_start_, &clutter_start_, &haze_start_})
        starts->resize(2 * samples);
    noise_start_.resize(2 * kMaxPersisted * samples);

    const auto lines = static_cast<std::size_t>(lines_);
    raw_gaps_.assign(lines + kSlack, 0.0f);
    gaps_.assign(lines + kSlack, 0.0f);
    beams_.assign(kBeamNumbers * lines + kSlack, 0.0f);
    breathing_.assign((samples / kBreathingNode + 2) * lines + kSlack, 0.0f);
    prepare_nodes(tables);
    streaks_.resize(kMostStreaks);
    for (auto* per_beam : {&faces_.depth_mm, &faces_.dome_mm, &faces_.peak, &faces_.cosine})
        per_beam->assign(lines + kSlack, 0.0f);
    plane_beams_.assign(4 * lines + kSlack, 0.0f);
    for (std::size_t l = 0; l < lines; ++l) {
        const auto& [o, d] =
            geometry.beams[std::min(l, static_cast<std::size_t>(geometry.scanlines) - 1)];
        int row = 0;
        for (const double value : {o.x, o.z, d.x, d.z})
            plane_beams_[static_cast<std::size_t>(row++) * lines + l] = static_cast<float>(value);
    }
    const std::size_t area = samples * static_cast<std::size_t>(stride_) + kSlack;
    // One allocation; rows begin on cache lines.
    const std::size_t line_of_floats = 16;
    const std::size_t echoes_at = has_clutter(tables) ? 4 : 3;
    const std::size_t planes = static_cast<std::size_t>(tables.looks) + echoes_at;
    planes_.assign(planes * area + line_of_floats, 0.0f);
    void* start = planes_.data();
    std::size_t space = planes_.size() * sizeof(float);
    auto* plane = static_cast<float*>(
        std::align(line_of_floats * sizeof(float), planes * area * sizeof(float), start, space));
    light_ = plane;
    tail_ = plane + area;
    power_ = plane + 2 * area;
    echoes_ = reinterpret_cast<std::int32_t*>(plane + echoes_at * area);
    if (has_clutter(tables)) clutter_ = plane + 3 * area;
    look_stride_ = static_cast<std::ptrdiff_t>(area);
    tail_from_.assign(lines / kBeamBlock, 0);
    own_tail_from_ = tail_from_;
    const auto threads = static_cast<std::size_t>(context.workers.threads());
    work_.assign(threads * kWorkRows * static_cast<std::size_t>(stride_), 0.0f);
    const auto ring_rows = static_cast<std::size_t>(std::max(2 * tables.axial_reach + 1, 3));
    ring_.assign(threads * 2 * ring_rows * static_cast<std::size_t>(tables.looks) *
                     static_cast<std::size_t>(stride_),
                 0.0f);
    next_row_.assign(threads, -1);
    envelope_.assign(threads * static_cast<std::size_t>(stride_), 0.0f);
    haze_.assign(static_cast<std::size_t>(cells_k_) * static_cast<std::size_t>(stride_), 0.0f);
    if (has_equalisation(tables) || has_speckle_reduction(tables)) cells_.resize(cells_k_, stride_);
    if (has_equalisation(tables)) equaliser_.resize(cells_k_, stride_);
    if (has_speckle_reduction(tables)) contrast_.resize(cells_k_, stride_, nodes_);
    shade_.assign(threads * 2 * static_cast<std::size_t>(lines_ + kSlack), 0);
    pairs_.assign(samples * static_cast<std::size_t>(pair_stride_) + kSlack, 0);
}

const float* PhysicalFast::power_row(int sample) const {
    return power_ + static_cast<std::ptrdiff_t>(sample) * stride_ + kMargin;
}

int PhysicalFast::shade(int sample, int line) const {
    return pairs_[static_cast<std::size_t>(sample) * static_cast<std::size_t>(pair_stride_) +
                  static_cast<std::size_t>(line)] &
           0xFF;
}

void PhysicalFast::render(const PhysicalFrame& f,
                          const BreathingField& breathing,
                          bool flip,
                          bool keep_all,
                          std::span<std::uint8_t> pixels) {
    const auto time_of = [&](Pass pass) -> double& {
        return pass_ms_[static_cast<std::size_t>(pass)];
    };
    PassTimer timer(context_.clock);
    met_ = {};
    find_contact(f);
    time_of(Pass::contact) = timer.lap_ms();
    time_of(Pass::needle) = sample_beams(f, breathing, keep_all);
    time_of(Pass::beams) = std::max(timer.lap_ms() - time_of(Pass::needle), 0.0);
    filter_rows(f);
    time_of(Pass::filter) = timer.lap_ms();
    make_grey(f);
    time_of(Pass::grey) = timer.lap_ms();
    scan_convert(context_.workers, context_.simd, conversion_, pairs_, geometry_, flip, pixels);
    time_of(Pass::convert) = timer.lap_ms();
}

}  // namespace sonocase::runtime
