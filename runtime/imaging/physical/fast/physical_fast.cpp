// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/fast/physical_fast.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <memory>

#include "runtime/imaging/core/host.h"
#include "runtime/imaging/core/scan_convert.h"
#include "runtime/imaging/physical/fast/beam_sampler.h"
#include "runtime/imaging/physical/fast/row_passes.h"

namespace sonocase::runtime {

using namespace physical;

namespace {

constexpr int kCellsAtOnce = 2;             // rows of cells that a thread filters at a time
constexpr int kGreyRows = 16;               // rows of samples that a thread turns to grey at a time
constexpr double kFaintestRinging = 1e-12;  // its square is still a normal number

// See physical_kernels.h.
std::int32_t pack_acoustics(const AcousticProperties& a, double frequency_mhz) {
    const double loss = a.attenuation * frequency_mhz * 0.1 * 2 / kDbPerLog2;
    const auto attenuation =
        static_cast<std::uint32_t>(std::lround(std::clamp(loss * 4096, 0.0, 65535.0)));
    const auto echo =
        static_cast<std::int32_t>(std::lround(std::clamp(a.echo_db * 16, -2047.0, 2047.0)));
    const std::uint32_t kind = a.kind == TissueKind::outside ? kPackedOutside
                               : a.kind == TissueKind::fluid ? kPackedFluid
                               : a.kind == TissueKind::gas   ? kPackedGas
                               : a.kind == TissueKind::bone  ? kPackedBone
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
    if (p.diffuse) word |= kPairDiffuse;
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

// What the blocks of a frame met, gathered from all threads.
struct MetByAny {
    std::atomic<bool> interfaces{false}, refraction{false}, hard{false}, needle{false}, fine{false},
        target{false}, wall{false}, parenchyma{false}, dome{false};

    void add(const PhysicalBlock& b) {
        if (b.boundary_met) interfaces.store(true, std::memory_order_relaxed);
        if (b.refraction_met) refraction.store(true, std::memory_order_relaxed);
        if (b.hard_met) hard.store(true, std::memory_order_relaxed);
        if (b.fine_met) fine.store(true, std::memory_order_relaxed);
        if (b.parenchyma_met) parenchyma.store(true, std::memory_order_relaxed);
        if (b.dome_met) dome.store(true, std::memory_order_relaxed);
        if (b.wall_met) wall.store(true, std::memory_order_relaxed);
        if (b.target_met) target.store(true, std::memory_order_relaxed);
    }
};

PhysicalTarget packed(const TargetBall& t) {
    const auto shape = [&](int row, int column) {
        return static_cast<float>(t.shape(row, column));
    };
    return {.x = static_cast<float>(t.centre_vx.x),
            .y = static_cast<float>(t.centre_vx.y),
            .z = static_cast<float>(t.centre_vx.z),
            .radius_mm = static_cast<float>(t.radius_mm),
            .reach_mm = static_cast<float>(t.reach_mm),
            .round = t.round,
            .shape = {shape(0, 0), shape(1, 1), shape(2, 2), shape(0, 1), shape(0, 2), shape(1, 2)},
            .acoustics = t.acoustics,
            .wall = static_cast<float>(t.wall),
            .fluid = t.fluid,
            .anywhere = t.anywhere,
            .covers = t.covers,
            .only_label = t.only_label,
            .level_up = {static_cast<float>(t.level_up.x), static_cast<float>(t.level_up.y),
                         static_cast<float>(t.level_up.z)},
            .level_mm = static_cast<float>(t.level_mm)};
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
    stride_ = kRowMargin + lines_ + kRowMargin + kRowSlack;
    pair_stride_ = (lines_ + kRowSlack - 1) / kRowSlack * kRowSlack;
    cells_k_ = (geometry.samples + kHazeCell - 1) / kHazeCell;
    cells_l_ = (geometry.scanlines + kHazeCell - 1) / kHazeCell;
    conversion_ = make_scan_conversion_table(context.jobs, geometry, pair_stride_);
    conversion_.offset.resize(conversion_.offset.size() + kRowSlack);
    conversion_.weight.resize(conversion_.weight.size() + kRowSlack);

    for (const AcousticProperties& a : scene.acoustics)
        acoustics_.push_back(pack_acoustics(a, tables.frequency_mhz));
    acoustics_.resize(256, 0);
    acoustics_wall_ = acoustics_;
    for (std::size_t l = 0; l < scene.acoustics.size(); ++l) {
        AcousticProperties a = scene.acoustics[l];
        a.echo_db += a.wall_db;
        acoustics_wall_[l] = pack_acoustics(a, tables.frequency_mhz);
    }
    dim_off_.assign(256, 1.0f);
    for (const std::int32_t word : acoustics_)
        dim_.push_back(static_cast<float>(std::exp2(-(word & 0xFFFF) / 4096.0 * geometry.step_mm)));
    fine_frames_.assign(kFineNumbers * 256, 0.0f);
    for (std::size_t l = 0; l < scene.fine.frames.size() && l < 256; ++l) {
        const FineFrame& frame = scene.fine.frames[l];
        if (frame.cube < 0) continue;
        acoustics_[l] |= kFineStructureBit;
        acoustics_wall_[l] |= kFineStructureBit;
        std::copy(frame.cube_from_voxel.begin(), frame.cube_from_voxel.end(),
                  fine_frames_.begin() + static_cast<std::ptrdiff_t>(kFineNumbers * l));
        fine_frames_[kFineNumbers * l + 9] =
            static_cast<float>(frame.cube * kFineEdge * kFineEdge * kFineEdge);
        fine_frames_[kFineNumbers * l + 10] = static_cast<float>(kFineLayers[frame.cube] - 1);
    }
    for (const double db : scene.max_structure_db)
        max_structure_.push_back(static_cast<std::int32_t>(std::lround(16 * db)));
    if (!max_structure_.empty()) max_structure_.resize(256, 0);
    for (const double db : scene.structure_dead_db)
        structure_dead_.push_back(static_cast<std::int32_t>(std::lround(16 * db)));
    if (!structure_dead_.empty()) structure_dead_.resize(256, 0);
    for (const TargetBall& t : scene.targets) targets_.push_back(packed(t));
    frame_acoustics_ = acoustics_;
    near_targets_.reserve(kMaxFrameBalls);
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

    const std::size_t lines = lines_;
    raw_gaps_.assign(lines + kRowSlack, 0.0f);
    gaps_.assign(lines + kRowSlack, 0.0f);
    beams_.assign(kBeamNumbers * lines + kRowSlack, 0.0f);
    breathing_.assign((samples / kBreathingNode + 2) * lines + kRowSlack, 0.0f);
    prepare_nodes(tables);
    streaks_.resize(kMaxStreaks);
    faces_.resize(lines + kRowSlack);
    plane_beams_.assign(4 * lines + kRowSlack, 0.0f);
    for (std::size_t l = 0; l < lines; ++l) {
        const auto& [o, d] =
            geometry.beams[std::min(l, static_cast<std::size_t>(geometry.scanlines) - 1)];
        int row = 0;
        for (const double value : {o.x, o.z, d.x, d.z})
            plane_beams_[row++ * lines + l] = static_cast<float>(value);
    }
    const std::size_t area = samples * stride_ + kRowSlack;
    // The planes share one allocation; rows begin on cache lines.
    const std::size_t line_of_floats = 16;
    const std::size_t echoes_at = has_clutter(tables) ? 4 : 3;
    const std::size_t planes = tables.looks + echoes_at;
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
    work_.assign(threads * kWorkRows * stride_, 0.0f);
    const int ring_rows = std::max(2 * tables.axial_reach + 1, 3);
    ring_.assign(threads * 2 * ring_rows * tables.looks * stride_, 0.0f);
    next_row_.assign(threads, -1);
    envelope_.assign(threads * stride_, 0.0f);
    haze_.assign(static_cast<std::size_t>(cells_k_) * stride_, 0.0f);
    if (has_equalisation(tables) || has_speckle_reduction(tables)) cells_.resize(cells_k_, stride_);
    if (has_equalisation(tables)) equaliser_.resize(cells_k_, stride_);
    if (has_speckle_reduction(tables)) contrast_.resize(cells_k_, stride_, nodes_);
    shade_.assign(threads * 2 * (lines_ + kRowSlack), 0);
    pairs_.assign(samples * pair_stride_ + kRowSlack, 0);
}

const float* PhysicalFast::power_row(int sample) const {
    return power_ + static_cast<std::ptrdiff_t>(sample) * stride_ + kRowMargin;
}

int PhysicalFast::shade(int sample, int line) const {
    return pairs_[static_cast<std::size_t>(sample) * pair_stride_ + line] & 0xFF;
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

void PhysicalFast::find_contact(const PhysicalFrame& f) {
    const int lines = geometry_.scanlines;
    context_.workers.for_each(lines_ / kBeamBlock, [&](int, int block) {
        const int first = block * kBeamBlock;
        find_gaps(scene_, geometry_, f, first, std::min(first + kBeamBlock, lines), raw_gaps_);
    });
    met_.beams_in_contact = smooth_gaps(geometry_, raw_gaps_, gaps_);
    if (f.press != nullptr) press_gaps(*f.press, geometry_, gaps_);
    contact_found_ = f.effects.contact;
    if (!f.effects.contact) std::fill(gaps_.begin(), gaps_.end(), 0.0f);
    met_.gap =
        std::any_of(gaps_.begin(), gaps_.begin() + lines, [](float gap) { return gap != 0.0f; });
}

void PhysicalFast::describe(RenderedFrame& rendered) const {
    if (presses_) rendered.press_view = &press_;
    if (!contact_found_) return;
    rendered.gaps_mm = std::span(gaps_).first(static_cast<std::size_t>(geometry_.scanlines));
    rendered.touching = met_.beams_in_contact;
}

void PhysicalFast::place_beams(const PhysicalFrame& f, int first) {
    const ScanGeometry& g = geometry_;
    const double inverse_voxel = 1 / scene_.voxel_mm;
    const auto limited = [](double v) { return static_cast<float>(std::clamp(v, -1e6, 1e6)); };
    for (int l = first; l < first + kBeamBlock; ++l) {
        const int line = std::min(l, g.scanlines - 1);
        const auto& [o, d] = g.beams[line];
        const Point3 origin = f.volume_from_probe * Point3{o.x, 0, o.z};
        const Vector3 beam = f.volume_from_probe.rotation * Vector3{d.x, 0, d.z};
        const PlanePoint n = press::beside(d);
        const Vector3 beside = f.volume_from_probe.rotation * Vector3{n.x, 0, n.z};
        const Vector3 from_origin = origin - scene_.grid.origin_mm;
        const auto put = [&](int number, double value) {
            beams_[static_cast<std::size_t>(number) * lines_ + l] = limited(value);
        };
        for (int axis = 0; axis < 3; ++axis) {
            put(kVoxelOrigin + axis, inverse_voxel * from_origin[axis]);
            put(kVoxelPerMm + axis, inverse_voxel * beam[axis]);
            put(kBeam + axis, beam[axis]);
            if (f.press != nullptr)
                put(kSideways + kVoxelPerMm + axis, inverse_voxel * beside[axis]);
        }
        put(kEdge, f.effects.contact ? tables_.edge[line] : 1);
        for (int side = 0; side < slice_.count; ++side) {
            const SpeckleSide& cut = slice_.sides[side];
            const Vector3* of[3] = {&cut.height, &cut.u, &cut.v};
            for (int i = 0; i < 3; ++i) {
                put(kSpeckleOrigin + 6 * side + i, dot(*of[i], from_origin));
                put(kSpecklePerMm + 6 * side + i, dot(*of[i], beam));
                if (f.press != nullptr)
                    put(kSideways + kSpecklePerMm + 6 * side + i, dot(*of[i], beside));
            }
        }
        put(kGap, static_cast<double>(gaps_[line]));
    }
}

void PhysicalFast::weigh_breathing(const PhysicalFrame& f,
                                   const BreathingField& breathing,
                                   int first) {
    const ScanGeometry& g = geometry_;
    // The weight is smooth over centimetres, so every fourth beam is worked out and those in
    // between are interpolated.
    constexpr int kEvery = 4;
    const int nodes = g.samples / kBreathingNode + 2;
    for (int node = 0; node < nodes; ++node) {
        float* row = breathing_.data() + static_cast<std::ptrdiff_t>(node) * lines_ + first;
        const int k = std::min(node * kBreathingNode, g.samples - 1);
        const double r = r_[k];
        float left = 0;
        for (int l = 0; l <= kBeamBlock; l += kEvery) {
            const int line = std::min(first + l, g.scanlines - 1);
            const double gap = static_cast<double>(std::max(gaps_[line], 0.0f));
            const double contact = tables_.rows[k].contact;
            press::PlaneShift shift;
            if (f.press != nullptr && k < press_.active) {
                const press::PressView::Shift at = press_.at(line, k);
                shift = {static_cast<double>(at.along_mm), static_cast<double>(at.side_mm), 0};
            }
            const Point3 at = point_on_beam(g, f, line, r, gap * contact, shift);
            const auto right = static_cast<float>(breathing.weight(at));
            if (l > 0) {
                for (int j = 0; j < kEvery; ++j)
                    row[l - kEvery + j] = left + (right - left) * static_cast<float>(j) / kEvery;
            }
            left = right;
        }
    }
}

// Chooses the targets that the slab can show.
void PhysicalFast::choose_targets(const PhysicalFrame& f, bool keep_all) {
    near_targets_.clear();
    if (!f.effects.targets) return;
    // Reach of the slab: over four deviations of the thickest row, roughness, and the random step
    // of the look-up.
    const double thick = 4.5 * tables_.rows.back().elevation_mm +
                         4.5 * tables_.rows.front().elevation_mm + kTargetReachMm + 2 +
                         norm(f.motion.breathing_mm);
    const Vector3 normal = f.volume_from_probe.rotation * Vector3{0, 1, 0};
    const Point3 origin = f.volume_from_probe * Point3{0, 0, 0};
    const std::vector<TargetBall>& balls = f.balls != nullptr ? *f.balls : scene_.targets;
    for (std::size_t t = 0; t < balls.size(); ++t) {
        const Point3 centre = scene_.grid.point_from_voxel(balls[t].centre_vx);
        if (keep_all || std::abs(dot(normal, centre - origin)) < thick + balls[t].reach_mm)
            near_targets_.push_back(f.balls != nullptr ? packed(balls[t]) : targets_[t]);
    }
}

// Finds the samples of a block of beams in which each of its targets can show: all but those whose
// tissue lies, in the plane, further off than ball, press, breath and gap together reach.
void PhysicalFast::place_targets(const PhysicalFrame& f,
                                 const PhysicalBlock& b,
                                 std::span<SampleRange> out) const {
    const ScanGeometry& g = geometry_;
    const int last = g.scanlines - 1, first = std::min(b.first_beam, last),
              end = std::min(b.first_beam + kBeamBlock - 1, last), middle = (first + end) / 2;
    if (b.keep_all || b.dome_mm != nullptr) {  // behind a mirror tissue shows elsewhere
        std::fill_n(out.begin(), b.target_count, SampleRange{0, g.samples});
        return;
    }
    double moved = norm(f.motion.breathing_mm) + kTargetReachMm + 0.5;
    if (f.press != nullptr) moved += f.press->farthest_mm();
    double gap = 0, aside = 0;
    for (int l = first; l <= end; ++l) gap = std::max(gap, double{gaps_[l]});
    for (const int l : {first, end}) {
        for (const double r : {0.0, g.depth_mm}) {
            const ScanGeometry::Beam &a = g.beams[l], &m = g.beams[middle];
            const double x = a.origin.x - m.origin.x + r * (a.direction.x - m.direction.x),
                         z = a.origin.z - m.origin.z + r * (a.direction.z - m.direction.z);
            aside = std::max(aside, std::sqrt(x * x + z * z));
        }
    }
    const Rigid probe_from_volume = inverse(f.volume_from_probe);
    for (int t = 0; t < b.target_count; ++t) {
        const PhysicalTarget& ball = b.targets[t];
        const Point3 p = probe_from_volume * scene_.grid.point_from_voxel(
                                                 {double{ball.x}, double{ball.y}, double{ball.z}});
        out[t] = samples_near(g, middle, {p.x, p.z}, double{ball.reach_mm} + moved + gap + aside);
    }
}

// Chooses the plates that the block's beams can show; if there are few beams, each may show all.
static_assert(kBlockStreaks == kMaxStreaks);
int PhysicalFast::choose_streaks(int first, std::span<PhysicalStreak> out) const {
    int count = 0;
    for (int n = 0; n < streak_count_ && count < static_cast<int>(out.size()); ++n) {
        const Streak& s = streaks_[n];
        if (s.line_begin >= first + kBeamBlock || s.line_end <= first) continue;
        out[count++] = {.x = static_cast<float>(s.centre.x),
                        .z = static_cast<float>(s.centre.z),
                        .normal_x = static_cast<float>(s.normal.x),
                        .normal_z = static_cast<float>(s.normal.z),
                        .per_width = static_cast<float>(1 / s.width_mm),
                        .per_length = static_cast<float>(2 / s.length_mm),
                        .bend = static_cast<float>(s.bend),
                        .amplitude = static_cast<float>(s.amplitude),
                        .ripple = static_cast<float>(s.ripple),
                        .per_ripple = static_cast<float>(s.per_ripple),
                        .phase = static_cast<float>(s.phase),
                        .sample_begin = s.sample_begin,
                        .sample_end = s.sample_end};
    }
    return count;
}

// Chooses the acoustic properties of the labels that suit the frame's effects.
void PhysicalFast::choose_acoustics(const PhysicalFrame& f) {
    frame_acoustics_ = f.effects.wall ? acoustics_wall_ : acoustics_;
    for (std::size_t l = 0; l < scene_.fine.frames.size(); ++l) {
        const bool parenchyma = scene_.fine.frames[l].cube == kParenchymaCube;
        if (!(parenchyma ? f.effects.parenchyma : f.effects.fine_structure))
            frame_acoustics_[l] &= ~kFineStructureBit;
    }
}

// Fills in the slab's directions and the anatomy's motion.
void PhysicalFast::set_poses(const PhysicalFrame& f, PhysicalBlock& b) const {
    const Vector3 across =
        (1 / scene_.voxel_mm) * (f.volume_from_probe.rotation * Vector3{0, 1, 0});
    const Vector3 sideways =
        (kLookupJitter / 32) * (f.volume_from_probe.rotation * Vector3{1, 0, 0});
    const Vector3 shift = (1 / scene_.voxel_mm) * f.motion.breathing_mm;
    for (int axis = 0; axis < 3; ++axis) {
        b.across[axis] = static_cast<float>(across[axis]);
        b.sideways[axis] = static_cast<float>(sideways[axis]);
        b.shift_voxel[axis] = static_cast<float>(shift[axis]);
    }
    b.cut_count = slice_.count;
    for (int side = 0; side < slice_.count; ++side) {
        const SpeckleSide& from = slice_.sides[side];
        SpeckleCut& cut = b.cuts[side];
        cut.u_per_height = static_cast<float>(from.u_per_height);
        cut.v_per_height = static_cast<float>(from.v_per_height);
        cut.per_normal = static_cast<float>(from.per_normal);
        cut.base = from.base;
        cut.until = static_cast<std::int32_t>(std::lround(from.until * 65536));
        cut.shift[0] = static_cast<float>(dot(from.height, f.motion.breathing_mm));
        cut.shift[1] = static_cast<float>(dot(from.u, f.motion.breathing_mm));
        cut.shift[2] = static_cast<float>(dot(from.v, f.motion.breathing_mm));
    }
    b.patch_per_voxel = static_cast<float>(scene_.voxel_mm / kPatchMm);
    b.per_spacing = (f.effects.elevation ? per_spacing_ : per_spacing_thin_).data();
    b.speckle_level = (f.effects.point_spread ? speckle_level_ : speckle_level_bare_).data();
    b.looks_at = looks_drawn_.data();
    b.look_stride = look_stride_;
    b.pulse_mm = f.effects.pulsation ? static_cast<float>(f.motion.pulse_mm) : 0;
    b.vein_mm = f.effects.pulsation ? static_cast<float>(f.motion.vein_mm) : 0;
    b.is_vein = scene_.is_vein.data();
}

// Fills in what the kernels look up: volumes, textures, tissues, targets.
void PhysicalFast::set_tables(const PhysicalFrame& f, PhysicalBlock& b) const {
    const CaseBundle& bundle = *scene_.bundle;
    b.table = reinterpret_cast<const std::int32_t*>(scene_.words.data());
    b.labels = reinterpret_cast<const std::int32_t*>(bundle.label_bricks.pool.data());
    b.echo = reinterpret_cast<const std::int32_t*>(bundle.echo_offset.pool.data());
    b.boundary = f.effects.boundaries && scene_.words.has_boundary()
                     ? reinterpret_cast<const std::int32_t*>(bundle.boundary.pool.data())
                     : nullptr;
    b.region = scene_.region.region != nullptr ? &region_ : nullptr;
    b.acoustics = frame_acoustics_.data();
    b.pairs = pairs_word_.data();
    b.rough = reinterpret_cast<const std::int32_t*>(scene_.textures->rough.data());
    b.fine =
        f.effects.fine_structure || f.effects.parenchyma ? scene_.textures->fine.data() : nullptr;
    b.max_structure = max_structure_.empty() ? nullptr : max_structure_.data();
    b.structure_dead =
        f.effects.parenchyma && !structure_dead_.empty() ? structure_dead_.data() : nullptr;
    b.fine_frames = fine_frames_.data();
    b.targets = near_targets_.data();
    b.target_count = static_cast<int>(near_targets_.size());
    b.size = scene_.grid.size;
    const Int3 table_blocks = scene_.words.blocks();
    b.blocks_x = table_blocks.x;
    b.blocks_xy = table_blocks.x * table_blocks.y;
    b.block_log2 = scene_.words.edge_log2();
    b.label_count = scene_.labels();
    b.voxel_mm = static_cast<float>(scene_.voxel_mm);
    b.roughness_mm = static_cast<float>(scene_.roughness_mm);
    b.rough_per_voxel = static_cast<float>(scene_.voxel_mm / kRoughVoxelMm);
    b.dim = dim_.data();
    b.dim_off = dim_off_.data();
}

// Returns what all blocks of a frame share.
PhysicalBlock PhysicalFast::block_of_frame(const PhysicalFrame& f, bool keep_all) const {
    const ScanGeometry& g = geometry_;
    PhysicalBlock b;
    b.lines = lines_;
    b.samples = g.samples;
    b.r = r_.data();
    b.contact = contact_.data();
    b.elevation = f.effects.elevation ? elevation_.data() : elevation_off_.data();
    b.interface_scale = interface_scale_.data();
    b.gain = gain_.data();
    b.elevation_start = elevation_start_.data();
    b.lookup_start = lookup_start_.data();
    set_poses(f, b);
    set_tables(f, b);
    b.press_view = f.press != nullptr ? &press_ : nullptr;
    b.closed_label = scene_.closed_label.data();
    b.step_mm = static_cast<float>(g.step_mm);
    b.dead_light = static_cast<float>(std::exp2(kDeadLog2));
    const auto decay = [&](double mm) { return static_cast<float>(std::exp(-g.step_mm / mm)); };
    b.decay = {decay(kBoneTailMm), decay(kBoneTailSlowMm), decay(kBoneFloorMm), decay(kGasTailMm)};
    b.reverb_mm = static_cast<float>(kReverbWidth * tables_.axial_mm);
    b.structure = f.effects.structure && scene_.words.has_echo();
    b.speckled = f.effects.speckle;
    b.interfaces = f.effects.interfaces;
    b.edge_shadow = f.effects.edge_shadow;
    b.attenuation = f.effects.attenuation;
    b.bone_tail = f.effects.bone_tail;
    b.gas_tail = f.effects.gas_ring_down;
    b.keep_all = keep_all;
    b.hard_scene = scene_.has_hard;
    b.stride = stride_;
    b.clutter_keep = static_cast<float>(tables_.haze_keep);
    b.clutter_gain = static_cast<float>(tables_.haze_gain);
    return b;
}

// Notes which effects the machine has, for the table of effects.
void PhysicalFast::meet_machine(const PhysicalFrame& f) {
    const Machine& m = tables_.machine;
    met_.edge_contact = m.contact.edge_db > 0 && m.contact.edge_fraction > 0;
    met_.compounding = tables_.looks > 1;
    met_.receiver_noise = has_noise(tables_) || m.noise.grain_db > 0;
    met_.blending = has_noise(tables_) && f.effects.noise && tables_.persisted > 1;
    met_.reverberation = has_clutter(tables_);
    met_.side_lobes = has_side_lobes(tables_);
    met_.equalisation = has_equalisation(tables_);
    met_.speckle_reduction = has_speckle_reduction(tables_);
    met_.binomial = m.post_filter;
    met_.sharpening = m.edge_enhancement > 0;
    met_.logarithm = has_logarithm(tables_);
    met_.shows_parenchyma = m.structures.parenchyma;
    met_.shows_streaks = m.structures.streaks;
    met_.shows_diaphragm = m.structures.diaphragm;
    met_.shows_wall = m.structures.wall;
}

double PhysicalFast::sample_beams(const PhysicalFrame& f,
                                  const BreathingField& breathing,
                                  bool keep_all) {
    const ScanGeometry& g = geometry_;
    for (int k = 0; k < g.samples; ++k) {
        elevation_start_[k] = noise_start(f.seed, NoiseUse::elevation, 0, k);
        lookup_start_[k] = noise_start(f.seed, NoiseUse::lookup, 0, k);
    }
    choose_targets(f, keep_all);
    choose_acoustics(f);
    presses_ = f.press != nullptr;
    if (presses_) press_.show(context_.simd, *f.press);
    slice_ = speckle_slice(f.volume_from_probe.rotation * Vector3{0, 1, 0}, tables_.cell_mm);
    const PhysicalBlock base = block_of_frame(f, keep_all);
    const bool breathes = f.effects.breathing && f.motion.breathes() && !breathing.empty();
    const std::span<const NeedleShape> needles =
        f.effects.needle ? f.needles : std::span<const NeedleShape>();
    std::array<NeedleStrip, kMaxNeedles> strips;
    for (std::size_t i = 0; i < needles.size(); ++i) strips[i] = NeedleStrip(needles[i]);
    streak_count_ =
        f.effects.streaks
            ? find_streaks(scene_, g, tables_, f, breathes ? &breathing : nullptr, gaps_, streaks_)
            : 0;
    context_.workers.for_each(lines_ / kBeamBlock, [&](int, int block) {
        place_beams(f, block * kBeamBlock);
        if (breathes) weigh_breathing(f, breathing, block * kBeamBlock);
    });
    search_nodes(f, base, breathes);
    const bool clutter = f.effects.clutter && has_clutter(tables_);
    MetByAny met;
    std::atomic<double> needle_ms{0};
    context_.workers.for_each(lines_ / kBeamBlock, [&](int, int block) {
        PhysicalBlock b = base;
        const int line = block * kBeamBlock;
        b.beams = beams_.data() + line;
        b.first_beam = line;
        b.white = noise_.white.data() + line;
        b.breathing = breathes ? breathing_.data() + line : nullptr;
        b.echoes = echoes_ + kRowMargin + line;
        b.light = light_ + kRowMargin + line;
        b.tail = tail_ + kRowMargin + line;
        std::array<PhysicalStreak, kBlockStreaks> streaks;
        b.plane = plane_beams_.data() + line;
        b.streaks = streaks.data();
        b.streak_count = choose_streaks(line, streaks);
        show_faces(line, b);
        std::array<SampleRange, kMaxFrameBalls> target_rows;
        if (b.target_count > 0) place_targets(f, b, target_rows);
        b.target_rows = target_rows.data();
        PhysicalWall wall;
        if (wall_shows_) {
            place_wall(keep_all, line, wall);
            b.wall = &wall;
        }
        b.clutter = clutter ? clutter_ + kRowMargin + line : nullptr;
        sample_beam_block(context_.simd, b);
        met.add(b);
        for (std::size_t i = 0; i < needles.size(); ++i) {
            NeedleRow row;
            int k0 = 0, k1 = 0;
            if (!strips[i].prepare_block(needles[i], g, line, keep_all, row, k0, k1)) continue;
            PassTimer timer(context_.clock);
            // A beam in air shows none, though its neighbours' light spreads into it.
            constexpr float kFarMm = 1e4f;
            for (int v = 0; v < kBeamBlock; ++v)
                if (gaps_[std::min(line + v, g.scanlines - 1)] < 0) row.origin_x[v] = kFarMm;
            draw_physical_needle(context_.simd, b, row, k0, k1);
            add_ms(needle_ms, timer.lap_ms());
            met.needle.store(true, std::memory_order_relaxed);
        }
        tail_from_[block] = b.tail_from;
    });
    if (tables_.spread_beams > 0) {
        spread_light();
    } else {
        mirror_rows(light_, 6);  // for the boxes of the aperture
    }
    join_tails();
    if (clutter) mirror_rows(clutter_, kMaxHazeReach);
    met_.pressed = f.press != nullptr;
    met_.breathes = f.motion.breathes();
    met_.pulses = f.motion.pulse_mm != 0 || f.motion.vein_mm != 0;
    met_.has_echo = scene_.words.has_echo();
    met_.interface = met.interfaces;
    met_.refraction = met.refraction;
    met_.hard = met.hard;
    met_.fine = met.fine;
    met_.target = met.target;
    met_.streaks = streak_count_ > 0;
    met_.dome = met.dome;
    met_.wall = met.wall;
    met_.parenchyma = met.parenchyma;
    met_.needle_given = !f.needles.empty();
    met_.needle = met.needle;
    meet_machine(f);
    return needle_ms.load() / context_.workers.threads();
}

void PhysicalFast::prepare_nodes(const Tables& tables) {
    nodes_.create(geometry_, tables);
    faces_of_nodes_.resize(nodes_.nodes);
    const std::size_t count = scene_.fine.frames.size();
    node_kinds_.assign(256, 0);
    for (std::size_t l = 0; l < count && l < node_kinds_.size(); ++l) {
        const TissueKind kind = scene_.acoustics[l].kind;
        node_kinds_[l] = (kind == TissueKind::gas ? kNodeGas : 0) |
                         (kind == TissueKind::bone ? kNodeBone : 0) |
                         (scene_.fine.frames[l].cube == kParenchymaCube ? kNodeOrgan : 0) |
                         (scene_.is_lung[l] ? kNodeLung : 0);
    }
    for (int l = 0; l < lines_; ++l) {
        const int line = std::min(l, geometry_.scanlines - 1);
        node_of_.push_back(nodes_.spacing.node_of(line));
        node_part_.push_back(nodes_.spacing.part(line));
    }
    const WallTables& sheets = tables.wall;
    PhysicalWall& w = wall_;
    w.every = nodes_.spacing.samples;
    w.rows = std::min(geometry_.samples,
                      static_cast<int>(kWallDepthMm / geometry_.step_mm) / w.every * w.every);
    w.per_row = 1 / static_cast<float>(w.every);
    w.per_mm = 1 / static_cast<float>(w.every * geometry_.step_mm);
    w.ground = static_cast<float>(16 * tables_.wall.ground_db);
    w.max_structure = 16 * tables_.wall.max_structure_db;
    w.outer = sheets.outer.echo.data();
    w.inner = sheets.inner.echo.data();
    w.outer_steps = sheets.outer.steps;
    w.inner_steps = sheets.inner.steps;
    w.steps_per_mm = static_cast<float>(sheets.steps_per_mm);
    const int rows = wall_node_rows();
    wall_nodes_.assign(3 * rows * lines_ + kRowSlack, 0.0f);
    wall_active_.assign(rows * (lines_ / kBeamBlock), 0);
    layer_nodes_.assign(3 * nodes_.at(nodes_.rows, 0), 0.0f);
}

// Moves nodes from where the beams run to where their tissue lies at rest.
void PhysicalFast::press_nodes(int first, int end) {
    NodeLattice& n = nodes_;
    const bool dents = press_.field->needle().moves();
    const std::span<const SceneChange::Pool> pools = press_.field->pools();
    for (int node = first; node < end; ++node) {
        const int line = n.spacing.line(node);
        // The samples that pools can move; where nothing else moves, the others stay.
        SampleRange pushed{geometry_.samples, 0};
        for (const SceneChange::Pool& pool : pools) {
            const SampleRange near =
                samples_near(geometry_, line, {pool.centre.x, pool.centre.z},
                             kPoolReaches * pool.radius_mm + press_.field->farthest_mm());
            if (near.begin >= near.end) continue;
            pushed = {std::min(pushed.begin, near.begin), std::max(pushed.end, near.end)};
        }
        const bool still = !press_.pressed && !dents;
        float along[3], side[3];
        for (int axis = 0; axis < 3; ++axis) {
            along[axis] = n.per_mm[axis][node];
            side[axis] = beams_[(kSideways + kVoxelPerMm + axis) * lines_ + line];
        }
        for (int row = 0; row < n.rows; ++row) {
            const int k = row * n.spacing.samples;
            if (k >= press_.active) break;
            const bool pushes = k >= pushed.begin && k < pushed.end;
            if (still && !pushes) continue;
            const press::PressView::Shift shift =
                dents || pushes ? press_.at(line, k) : press_.by_probe(line, k);
            const std::size_t at = n.at(row, node);
            n.x[at] += along[0] * shift.along_mm + side[0] * shift.side_mm;
            n.y[at] += along[1] * shift.along_mm + side[1] * shift.side_mm;
            n.z[at] += along[2] * shift.along_mm + side[2] * shift.side_mm;
        }
    }
}

// Places a block of nodes; first: its first node. Comes after place_beams and weigh_breathing of
// all beams.
void PhysicalFast::place_nodes(const PhysicalFrame& f, bool breathes, int first) {
    NodeLattice& n = nodes_;
    const int end = std::min(first + kBeamBlock, n.nodes);
    const auto number = [&](int row, int node) {
        return beams_[static_cast<std::size_t>(row) * lines_ + n.spacing.line(node)];
    };
    for (int node = first; node < end; ++node) {
        for (int axis = 0; axis < 3; ++axis) {
            n.origin[axis][node] = number(kVoxelOrigin + axis, node);
            n.per_mm[axis][node] = number(kVoxelPerMm + axis, node);
        }
        n.gap[node] = number(kGap, node);
    }
    const auto walk = [&](int axis, std::vector<float>& out) {
        const float *from = n.origin[axis].data(), *way = n.per_mm[axis].data(),
                    *gap = n.gap.data();
        for (int row = 0; row < n.rows; ++row) {
            const auto r = static_cast<float>(n.spacing.r_mm(row));
            const float contact = n.contact[row];
            float* to = out.data() + n.at(row, 0);
            for (int node = first; node < end; ++node)
                to[node] = from[node] + way[node] * (r + gap[node] * contact);
        }
    };
    walk(0, n.x);
    walk(1, n.y);
    walk(2, n.z);
    if (f.press != nullptr) press_nodes(first, end);
    if (!breathes) return;
    const Vector3 shift = (1 / scene_.voxel_mm) * f.motion.breathing_mm;
    const int last = geometry_.samples - 1;
    for (int row = 0; row < n.rows; ++row) {
        const int k = std::min(row * n.spacing.samples, last);
        const float* above =
            breathing_.data() + static_cast<std::ptrdiff_t>(k / kBreathingNode) * lines_;
        const float part = static_cast<float>(k % kBreathingNode) / kBreathingNode;
        for (int node = first; node < end; ++node) {
            const float* w = above + n.spacing.line(node);
            const float weight = w[0] + (w[lines_] - w[0]) * part;
            const std::size_t at = n.at(row, node);
            n.x[at] -= weight * static_cast<float>(shift.x);
            n.y[at] -= weight * static_cast<float>(shift.y);
            n.z[at] -= weight * static_cast<float>(shift.z);
        }
    }
}

void PhysicalFast::search_nodes(const PhysicalFrame& f, const PhysicalBlock& base, bool breathes) {
    faces_.any_dome = false;
    faces_found_ = scene_.has_gas && (f.effects.diaphragm || f.effects.gas_ring_down);
    wall_shows_ = f.effects.wall && !scene_.layers.empty();
    const bool reduced = reduces_speckle(f);
    if (!faces_found_ && !wall_shows_ && !reduced) return;
    context_.workers.for_each(nodes_.stride / kBeamBlock, [&](int, int block) {
        const int first = block * kBeamBlock;
        place_nodes(f, breathes, first);
        if (faces_found_) find_faces(f, base, first);
        if (reduced) {
            search_noise(context_.simd, {&nodes_, first, contrast_.rows, kHazeCell, &scene_.layers,
                                         contrast_.noise.data()});
        }
        if (!wall_shows_) return;
        float* out = layer_nodes_.data();
        const std::size_t plane = nodes_.at(nodes_.rows, 0);
        search_layers(context_.simd, {&nodes_, first, wall_node_rows(), &scene_.layers,
                                      static_cast<float>(tables_.wall.wave_mm),
                                      static_cast<float>(tables_.wall.own_wave_mm), out,
                                      out + plane, out + 2 * plane});
    });
    if (faces_found_) join_faces(geometry_, nodes_.spacing, faces_of_nodes_, faces_);
}

// Finds the faces of gas of a block of nodes; first: its first node.
void PhysicalFast::find_faces(const PhysicalFrame& f, const PhysicalBlock& base, int first) {
    FaceSearch search;
    search.nodes = &nodes_;
    search.first = first;
    search.depth_mm = static_cast<float>(geometry_.depth_mm);
    search.block = &base;
    search.kinds = node_kinds_.data();
    search_faces(context_.simd, search);
    for (int i = 0; i < std::min(kBeamBlock, nodes_.nodes - first); ++i) {
        FaceNode& face = faces_of_nodes_[first + i];
        face = {search.depth[i], 0};
        if (face.depth_mm >= kNoFace) continue;
        const auto node = [&](int row) {
            const std::size_t at = nodes_.at(row, first + i);
            return Point3{static_cast<double>(nodes_.x[at]), static_cast<double>(nodes_.y[at]),
                          static_cast<double>(nodes_.z[at])};
        };
        const int row = search.row[i];
        const Point3 behind = node(row), before = node(row - 1);
        const int label = label_at(scene_, static_cast<int>(std::nearbyint(behind.x)),
                                   static_cast<int>(std::nearbyint(behind.y)),
                                   static_cast<int>(std::nearbyint(behind.z)));
        if (scene_.is_lung[label]) {
            const double part =
                (static_cast<double>(face.depth_mm) - nodes_.spacing.r_mm(row - 1)) /
                (nodes_.spacing.r_mm(row) - nodes_.spacing.r_mm(row - 1));
            show_lung(scene_, f, before + part * (behind - before), face);
        }
        if (search.dome[i] != 0 && f.effects.diaphragm) face.peak = dome_peak(scene_, behind);
    }
}

// Hands the faces of gas to a block of beams; line: its first beam.
void PhysicalFast::show_faces(int line, PhysicalBlock& b) const {
    if (!faces_found_) return;
    b.face_mm = faces_.depth_mm.data() + line;
    b.face_peak = faces_.peak.data() + line;
    b.cosine = faces_.cosine.data() + line;
    b.face_tail = faces_.tail.data() + line;
    b.reverb_loss = faces_.reverb_loss.data() + line;
    if (!faces_.any_dome) return;
    const float* dome = faces_.dome_mm.data() + line;
    if (std::all_of(dome, dome + kBeamBlock, [](float mm) { return mm >= kNoFace; })) return;
    b.dome_mm = dome;
    b.dome_scale = static_cast<float>(tables_.dome_scale);
    b.mirror_light = static_cast<float>(std::pow(10.0, kMirrorDb / 20));
}

// Fills in the wall at the beams of a block (first: its first beam), and which rows of nodes can
// show a sheet: beyond the ends of both tables there is none.
void PhysicalFast::place_wall(bool keep_all, int first, PhysicalWall& w) {
    w = wall_;
    const int rows = wall_node_rows();
    const std::ptrdiff_t plane = static_cast<std::ptrdiff_t>(rows) * lines_;
    float* out = wall_nodes_.data() + first;
    w.depth = out;
    w.above = out + plane;
    w.course = out + 2 * plane;
    std::uint8_t* active =
        wall_active_.data() + static_cast<std::ptrdiff_t>(first / kBeamBlock) * rows;
    w.active = active;
    constexpr auto kBefore = static_cast<float>(kWallBeforeMm);
    const float outer_end = static_cast<float>(w.outer_steps) / w.steps_per_mm - kBefore,
                inner_end = static_cast<float>(w.inner_steps) / w.steps_per_mm - kBefore;
    const std::size_t node_plane = nodes_.at(nodes_.rows, 0);
    const int begin = node_of_[first], end = node_of_[first + kBeamBlock - 1] + 1;
    for (int row = 0; row < rows; ++row) {
        const float *depth = layer_nodes_.data() + nodes_.at(row, 0), *above = depth + node_plane;
        bool shows = keep_all;
        for (int node = begin; node <= end; ++node) {
            shows = shows || (depth[node] > -kBefore && above[node] > -kBefore &&
                              (depth[node] < outer_end || above[node] < inner_end));
        }
        active[row] = shows;
        if (shows && row > 0) active[row - 1] = 1;
    }
    for (int row = 0; row < rows; ++row) {
        if (!active[row] && (row == 0 || !active[row - 1])) continue;
        for (int number = 0; number < 3; ++number) {
            const float* from = layer_nodes_.data() + nodes_.at(row, 0) + number * node_plane;
            float* to = out + number * plane + static_cast<std::ptrdiff_t>(row) * lines_;
            for (int l = 0; l < kBeamBlock; ++l) {
                const float* p = from + node_of_[first + l];
                to[l] = p[0] + (p[1] - p[0]) * node_part_[first + l];
            }
        }
    }
}

// Mirrors a row beyond its outermost beams, `reach` beams far.
void PhysicalFast::mirror_row(float* row, int reach) const {
    const int lines = geometry_.scanlines;
    for (int j = 0; j < reach; ++j) {
        row[-1 - j] = row[std::min(j, lines - 1)];
        row[lines + j] = row[std::max(lines - 1 - j, 0)];
    }
}

void PhysicalFast::mirror_rows(float* plane, int reach) const {
    for (int k = 0; k < geometry_.samples; ++k)
        mirror_row(plane + kRowMargin + static_cast<std::ptrdiff_t>(k) * stride_, reach);
}

// Spreads light to neighbouring beams on its way down. Each row needs the one above, so one thread
// does them all; it is a small part of a frame.
void PhysicalFast::spread_light() {
    constexpr int kReach = std::max(kMaxSpread, 6);  // 6: the boxes of the aperture
    PhysicalSpreadTask t;
    t.lines = lines_;
    t.beams = tables_.spread_beams;
    t.share = static_cast<float>(tables_.spread_share);
    t.was = work_.data() + kRowMargin;
    for (int k = 0; k < geometry_.samples; ++k) {
        t.light = light_ + kRowMargin + static_cast<std::ptrdiff_t>(k) * stride_;
        if (k == 0) {
            std::copy_n(t.light, lines_, t.was);
        } else {
            spread_light_row(context_.simd, t);
        }
        mirror_row(t.light, kReach);
        t.above = t.light;
    }
}

// The whole aperture sees a tail, as it does light. The tails of a block therefore begin with the
// earliest of its own and its neighbours', and the rows above its own tails are cleared.
void PhysicalFast::join_tails() {
    const int blocks = static_cast<int>(tail_from_.size());
    own_tail_from_ = tail_from_;
    const auto earliest = [&](int block, int reach) {
        std::int32_t from = geometry_.samples;
        for (int b = std::max(block - reach, 0); b <= std::min(block + reach, blocks - 1); ++b)
            from = std::min(from, own_tail_from_[b]);
        return from;
    };
    bool any = false;
    for (int b = 0; b < blocks; ++b) {
        for (std::int32_t k = earliest(b, 2); k < own_tail_from_[b]; ++k) {
            std::fill_n(
                tail_ + static_cast<std::ptrdiff_t>(k) * stride_ + kRowMargin + b * kBeamBlock,
                kBeamBlock, 0.0f);
        }
        tail_from_[b] = earliest(b, 1);
        any = any || own_tail_from_[b] < geometry_.samples;
    }
    if (any) mirror_rows(tail_, 6);
}

// Fills in the inputs of a row's filter across the beams.
void PhysicalFast::fill_row_task(const PhysicalFrame& f, int k, PhysicalRowTask& t) const {
    const bool tails = f.effects.bone_tail || f.effects.gas_ring_down || f.effects.needle;
    const int persisted = f.effects.persistence ? tables_.persisted : 1;
    const Row& row = tables_.rows[k];
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(k) * stride_ + kRowMargin;
    t.echoes = echoes_ + at;
    t.light = light_ + at;
    t.looks = row.looks_drawn;
    const double all = std::sqrt(static_cast<double>(row.looks)) / row.gain;
    t.inverse_gain = static_cast<float>(all);
    const double ringing = face_clutter(row, f.effects) * std::sqrt(row.drawn);
    t.near_field = ringing > kFaintestRinging ? static_cast<float>(ringing) : 0;
    t.clutter = f.effects.clutter && clutter_ != nullptr ? clutter_ + at : nullptr;
    t.clutter_reach = row.haze_reach;
    t.clutter_drawn = static_cast<float>(row.drawn);
    t.tail = tails ? tail_ + at : nullptr;
    t.sample = k;
    t.clutter_re = noise_.white.data() + noise_start(f.seed, NoiseUse::clutter_re, 0, k);
    t.clutter_im = noise_.white.data() + noise_start(f.seed, NoiseUse::clutter_im, 0, k);
    if (faces_found_ && faces_.any_slides && f.effects.gas_ring_down) {
        const LungGrain grain = lung_grain(f);
        t.slides = faces_.slides.data();
        for (int n = 0; n < 2; ++n) {
            const std::uint32_t field = grain.field + static_cast<std::uint32_t>(n);
            t.lung_re[n] =
                noise_.white.data() + noise_start(f.seed, NoiseUse::clutter_re, field, k);
            t.lung_im[n] =
                noise_.white.data() + noise_start(f.seed, NoiseUse::clutter_im, field, k);
            t.lung_weight[n] = grain.weight[n];
        }
    }
    t.noise = static_cast<float>(row.noise * all * std::sqrt(0.5) / 32);
    t.noise_rows = f.effects.noise && has_noise(tables_) ? persisted : 0;
    for (int j = 0; j < t.noise_rows; ++j) {
        const std::uint32_t frame = f.frame - static_cast<std::uint32_t>(j);
        t.noise_re[j] = noise_.fine.data() + noise_start(f.seed, NoiseUse::electronic_re, frame, k);
        t.noise_im[j] = noise_.fine.data() + noise_start(f.seed, NoiseUse::electronic_im, frame, k);
        t.noise_weight[j] = f.effects.persistence ? static_cast<float>(tables_.persistence[j]) : 1;
    }
    t.lateral = row.lateral.data() + kMaxLateral;
    t.reach = row.reach;
}

void PhysicalFast::filter_rows(const PhysicalFrame& f) {
    const ScanGeometry& g = geometry_;
    const int reach = f.effects.point_spread ? tables_.axial_reach : 0;
    const int ring_rows = std::max(2 * tables_.axial_reach + 1, 3);
    static constexpr std::array<float, 1> kOneTap{1.0f};
    const bool haze = f.effects.haze && has_side_lobes(tables_);
    const bool even = f.effects.equalisation && has_equalisation(tables_);
    const bool reduced = reduces_speckle(f), cells = even || reduced;
    const auto haze_level =
        static_cast<float>(std::pow(10.0, tables_.machine.haze.side_lobe_db / 20));
    start_rows();
    context_.workers.for_each((cells_k_ + kCellsAtOnce - 1) / kCellsAtOnce, [&](int part,
                                                                                int item) {
        const int begin = item * kCellsAtOnce * kHazeCell;
        const int end = std::min(begin + kCellsAtOnce * kHazeCell, g.samples);
        float* work = work_.data() + static_cast<std::ptrdiff_t>(part) * kWorkRows * stride_;
        const std::ptrdiff_t ring_size = static_cast<std::ptrdiff_t>(2) * ring_rows * stride_;
        float* ring = ring_.data() + part * tables_.looks * ring_size;
        float* envelope = envelope_.data() + static_cast<std::ptrdiff_t>(part) * stride_;
        const auto ring_re = [&](int k) {
            return ring + static_cast<std::ptrdiff_t>(2 * ((k + ring_rows) % ring_rows)) * stride_;
        };
        const auto ring_im = [&](int k) { return ring_re(k) + stride_; };
        PhysicalRowTask row_task;
        row_task.lines = lines_;
        row_task.scanlines = g.scanlines;
        row_task.tail_from = tail_from_.data();
        row_task.point_spread = f.effects.point_spread;
        row_task.work_re = work + kRowMargin;
        row_task.work_im = work + stride_ + kRowMargin;
        row_task.work_light = work + 2 * static_cast<std::ptrdiff_t>(stride_) + kRowMargin;
        row_task.work_clutter = work + 3 * static_cast<std::ptrdiff_t>(stride_) + kRowMargin;
        row_task.look_stride = look_stride_;
        row_task.out_stride = ring_size;
        const auto fill = [&](int k) {
            if (k < 0 || k >= g.samples) {  // there is nothing beyond the picture
                for (int look = 0; look < tables_.looks; ++look)
                    std::fill_n(ring_re(k) + look * ring_size, 2 * stride_, 0.0f);
                return;
            }
            fill_row_task(f, k, row_task);
            row_task.out_re = ring_re(k);
            row_task.out_im = ring_im(k);
            filter_row_across(context_.simd, row_task);
        };
        int& next = next_row_[part];
        if (next != begin) {
            for (int k = begin - reach; k < begin + reach; ++k) fill(k);
        }
        next = end;
        PhysicalPowerTask t;
        const float* rows_re[2 * kMaxAxial + 1];
        const float* rows_im[2 * kMaxAxial + 1];
        t.lines = lines_;
        t.re = rows_re;
        t.im = rows_im;
        t.look_stride = ring_size;
        t.axial =
            f.effects.point_spread ? tables_.axial.data() + kMaxAxial - reach : kOneTap.data();
        t.axial_count = 2 * reach + 1;
        t.envelope_sum = haze || cells ? envelope : nullptr;
        t.work_clutter = row_task.work_clutter;
        for (int k = begin; k < end; ++k) {
            if (k % kHazeCell == 0) std::fill_n(envelope, lines_, 0.0f);
            fill(k + reach);
            for (int j = -reach; j <= reach; ++j) {
                rows_re[j + reach] = ring_re(k + j);
                rows_im[j + reach] = ring_im(k + j);
            }
            const Row& row = tables_.rows[k];
            const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(k) * stride_ + kRowMargin;
            t.gain = static_cast<float>(row.gain);
            t.looks = row.looks;
            const double face = face_clutter(row, f.effects);
            t.steady =
                face > kFaintestRinging ? static_cast<float>(face * face * (1 - row.drawn)) : 0;
            t.clutter = f.effects.clutter && clutter_ != nullptr ? clutter_ + at : nullptr;
            t.clutter_reach = row.haze_reach;
            t.clutter_steady = static_cast<float>(1 - row.drawn);
            t.power = power_ + at;
            make_power_row(context_.simd, t);
            const bool last = k % kHazeCell == kHazeCell - 1 || k == g.samples - 1;
            if (cells && last) std::copy_n(envelope, lines_, cells_.row(k / kHazeCell));
            if (haze && last)
                spread_haze(k / kHazeCell, haze_level / static_cast<float>(k % kHazeCell + 1),
                            envelope);
        }
    });
    if (even) equaliser_.make_gain(context_.simd, cells_, g, tables_);
    if (reduced) {
        contrast_.make(context_.simd, {&cells_, even ? &equaliser_ : nullptr, &g, &tables_, &nodes_,
                                       node_of_.data(), node_part_.data()});
    }
}

// Makes one row of the haze: the mean envelope over cells (`level` times the sum over a cell's
// samples), spread to both sides and interpolated back to beams.
void PhysicalFast::spread_haze(int cell_row, float level, const float* envelope) {
    const int lines = geometry_.scanlines, last = cells_l_ - 1;
    std::array<float, 4096 / kHazeCell + 1> sums, wide{};
    for (int cell = 0; cell <= last; ++cell) {
        float sum = 0;
        for (int l = cell * kHazeCell; l < std::min((cell + 1) * kHazeCell, lines); ++l)
            sum += envelope[l];
        sums[cell] = sum;
    }
    for (int cell = 0; cell <= last; ++cell) {
        const int first = std::max(cell - kHazeReach, 0), end = std::min(cell + kHazeReach, last);
        float sum = 0;
        for (int j = first; j <= end; ++j) sum += sums[j];
        const int beams = std::min((end + 1) * kHazeCell, lines) - first * kHazeCell;
        wide[cell] = level * sum / static_cast<float>(beams);
    }
    // Between the middles of the cells.
    constexpr int kHalf = kHazeCell / 2;
    float* row = haze_.data() + static_cast<std::ptrdiff_t>(cell_row) * stride_;
    std::fill_n(row, kHalf, wide[0]);
    for (int cell = 0; cell < last; ++cell) {
        const float from = wide[cell], step = (wide[cell + 1] - from) / kHazeCell;
        for (int j = 0; j < kHazeCell; ++j)
            row[cell * kHazeCell + kHalf + j] = from + step * (static_cast<float>(j) + 0.5f);
    }
    std::fill_n(row + last * kHazeCell + kHalf, kHalf, wide[last]);
}

// Fills in the inputs of a row's compression.
void PhysicalFast::fill_grey_task(const PhysicalFrame& f, int k, PhysicalGreyTask& t) const {
    const Row& row = tables_.rows[k];
    const GreyLine grey = grey_line(tables_.machine.grey, f.dynamic_range_db);
    const double gain_db = row.unit_db + static_cast<double>(f.row_gain_db[k]);
    t.per_log2 = static_cast<float>(grey.per_db * 0.5 * kDbPerLog2);
    t.offset = static_cast<float>(grey.of_unit + grey.per_db * gain_db);
    t.power = power_ + static_cast<std::ptrdiff_t>(k) * stride_ + kRowMargin;
    const double grain = grain_of(tables_, f.effects);
    t.grain =
        grain > 0 ? noise_.white.data() + noise_start(f.seed, NoiseUse::grain, 0, k) : nullptr;
    t.grain_log2 = static_cast<float>(grain / 32);
    t.haze_above = nullptr;
    // Between the middles of the cells.
    const double at = std::clamp((k + 0.5) / kHazeCell - 0.5, 0.0, cells_k_ - 1.0);
    const int k0 = std::min(static_cast<int>(at), std::max(cells_k_ - 2, 0)),
              k1 = std::min(k0 + 1, cells_k_ - 1);
    if (f.effects.equalisation && has_equalisation(tables_)) {
        t.even_above = equaliser_.gain_row(k0);
        t.even_below = equaliser_.gain_row(k1);
    }
    t.even_mix = static_cast<float>(at - k0);
    if (reduces_speckle(f)) {
        t.middle_above = contrast_.middle_row(k0);
        t.middle_below = contrast_.middle_row(k1);
        t.change_above = contrast_.change_row(k0);
        t.change_below = contrast_.change_row(k1);
    }
    if (f.effects.haze && has_side_lobes(tables_)) {
        t.haze_above = haze_.data() + static_cast<std::ptrdiff_t>(k0) * stride_;
        t.haze_below = haze_.data() + static_cast<std::ptrdiff_t>(k1) * stride_;
        t.haze_mix = static_cast<float>(at - k0);
        for (int j = 0; j < 2; ++j) {
            t.haze_re[j] = noise_.streak.data() +
                           noise_start(f.seed, NoiseUse::haze_re, 0, k / kHazeGrain + j);
            t.haze_im[j] = noise_.streak.data() +
                           noise_start(f.seed, NoiseUse::haze_im, 0, k / kHazeGrain + j);
        }
        const double mix = static_cast<double>(k % kHazeGrain) / kHazeGrain;
        const double level = 1 / std::sqrt(mix * mix + (1 - mix) * (1 - mix));
        t.haze_first = static_cast<float>(level * (1 - mix));
        t.haze_second = static_cast<float>(level * mix);
    }
}

void PhysicalFast::make_grey(const PhysicalFrame& f) {
    const ScanGeometry& g = geometry_;
    const int ring_rows = std::max(2 * tables_.axial_reach + 1, 3);
    start_rows();
    context_.workers.for_each((g.samples + kGreyRows - 1) / kGreyRows, [&](int part, int item) {
        const int begin = item * kGreyRows, end = std::min(begin + kGreyRows, g.samples);
        float* ring = ring_.data() +
                      static_cast<std::ptrdiff_t>(part) * tables_.looks * 2 * ring_rows * stride_;
        const auto ring_at = [&](int k) {
            return ring + static_cast<std::ptrdiff_t>(k % 3) * stride_;
        };
        const auto plain_at = [&](int k) {
            return ring_at(k) + static_cast<std::ptrdiff_t>(3) * stride_;
        };
        std::uint8_t* shades =
            shade_.data() + static_cast<std::ptrdiff_t>(part) * 2 * (lines_ + kRowSlack);
        const auto shade_at = [&](int k) {
            return shades + static_cast<std::ptrdiff_t>(k % 2) * (lines_ + kRowSlack);
        };
        PhysicalGreyTask t;
        t.lines = lines_;
        t.scanlines = g.scanlines;
        const MachineGrey& grey = tables_.machine.grey;
        t.logarithm = has_logarithm(tables_);
        t.low = static_cast<float>(lowest_grey(grey));
        t.floor = static_cast<float>(grey.floor);
        t.knee = static_cast<float>(grey.knee);
        t.knee_slope = static_cast<float>(grey.knee_slope);
        const auto weight = static_cast<float>(filter_weight(tables_, f.effects));
        const bool filtered = weight != 0, plain = filtered && weight != 1;
        t.filtered = filtered;
        t.work =
            work_.data() + static_cast<std::ptrdiff_t>(part) * kWorkRows * stride_ + kRowMargin;
        const auto fill = [&](int k) {
            fill_grey_task(f, k, t);
            t.out = ring_at(k);
            t.plain = plain ? plain_at(k) : nullptr;
            make_physical_grey(context_.simd, t);
        };
        const auto shade = [&](int k) {
            const int above = std::max(k - 1, 0), below = std::min(k + 1, g.samples - 1);
            make_physical_shade(context_.simd,
                                {lines_, ring_at(above), ring_at(k), ring_at(below), filtered,
                                 f.effects.grey_map && has_logarithm(tables_),
                                 plain ? plain_at(k) : nullptr, weight, shade_at(k)});
        };
        // Shade row k needs grey rows k - 1 .. k + 1; pair row k needs shade rows k and k + 1.
        int& next = next_row_[part];
        if (next != begin) {
            for (int k = std::max(begin - 1, 0); k <= std::min(begin + 1, g.samples - 1); ++k)
                fill(k);
            shade(begin);
        }
        next = end;
        for (int k = begin; k < end; ++k) {
            int lower = k;
            if (k + 1 < g.samples) {
                lower = k + 1;
                if (k + 2 < g.samples) fill(k + 2);
                shade(k + 1);
            }
            pair_rows(context_.simd, shade_at(k), shade_at(lower), lines_,
                      pairs_.data() + static_cast<std::ptrdiff_t>(k) * pair_stride_);
        }
    });
}

}  // namespace sonocase::runtime
