// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/physical_formation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "runtime/imaging/core/host.h"
#include "runtime/imaging/physical/fast/physical_fast.h"
#include "runtime/imaging/physical/model/opening_gain.h"
#include "runtime/imaging/physical/model/read_ahead.h"
#include "runtime/imaging/physical/reference/physical_reference.h"

namespace sonocase::runtime {
namespace {

Machine chosen_machine(const Exercise& exercise, const RenderOptions& options) {
    return options.machine ? *options.machine : physical::default_machine(exercise.probe);
}

Machine machine_of(const FormationInput& input) {
    Machine machine = chosen_machine(input.exercise, input.options);
    if (input.options.looks > 0)
        machine.looks.count = machine.looks.near_count = input.options.looks;
    return machine;
}

PhysicalEffects shown_by(PhysicalEffects on, const MachineStructures& machine) {
    on.parenchyma = on.parenchyma && machine.parenchyma;
    on.streaks = on.streaks && machine.streaks;
    on.diaphragm = on.diaphragm && machine.diaphragm;
    on.wall = on.wall && machine.wall;
    return on;
}

// A guide wire is coiled, and sends some echo back at every angle; a catheter's walls are smooth
// plastic, drawn as thick as the samples lie apart. Diameters are those of a usual central line;
// the rest is assumed.
constexpr NeedleMake kWire{"wire", "", 0.9, 0.12, 0.2, 0.12, 0.12, true, 0, 0, 0, 0};
constexpr NeedleMake kCatheterWall{"catheter", "", 0.6, 0.15, 0.2, 0.15, 0.15, false, 0, 0, 0, 0};
NeedleShape shape_of(const NeedleMake& make, double echo, double tail) {
    NeedleShape shape;
    shape.make = &make;
    shape.radius_mm = 0.5 * make.diameter_mm;
    shape.echo = echo;
    shape.tail = tail;
    return shape;
}
constexpr double kCatheterMm = 2.3;  // from wall to wall

class PhysicalFormation final : public ImageFormation {
  public:
    PhysicalFormation(PhysicalScene scene, PhysicalNoise noise, const FormationInput& input)
        : exercise_(input.exercise),
          scene_(std::move(scene)),
          noise_(std::move(noise)),
          blocks_(input.bundle.blocks()),
          seed_(input.options.seed),
          reference_(input.options.kind == RendererKind::reference),
          keep_all_(input.effects.keep_all),
          chosen_(switches_of<PhysicalEffects>(kPhysicalEffects, input.effects.on)),
          switches_(chosen_),
          shown_(shown_by(switches_, machine_of(input).structures)),
          context_(input.context),
          machine_(machine_of(input)) {
        if (exercise_.breathing.amplitude_mm != 0) breathing_ = BreathingField(*input.bundle);
        if (scene_.has_acts) balls_.reserve(kMaxFrameBalls);
        const auto make_background = input.options.host.make_background;
        if (input.options.read_ahead && blocks_ != nullptr && !reference_ &&
            make_background != nullptr)
            ahead_.emplace(*blocks_, scene_.grid, make_background());
    }

    void add_level(const ScanGeometry& geometry, double looks) override {
        Level& level = *levels_.emplace_back(std::make_unique<Level>());
        level.geometry = geometry;
        Machine machine = machine_;
        const auto share = [looks](int count) {
            return std::max(1, static_cast<int>(std::lround(looks * count)));
        };
        machine.looks.count = share(machine.looks.count);
        machine.looks.near_count = share(machine.looks.near_count);
        level.tables = physical::make_tables(exercise_.probe, machine, geometry);
        if (!opening_)  // of the first, for all: they differ in beams and samples alone
            opening_ = physical::opening_gain(scene_, exercise_, level.tables, geometry);
        for (physical::Row& row : level.tables.rows)
            row.unit_db += opening_->at(row.r_mm / geometry.depth_mm);
        if (reference_) return;
        level.fast = std::make_unique<PhysicalFast>(scene_, geometry, level.tables, noise_,
                                                    press::press_face(exercise_.probe), context_);
        level.reach = ScanReach(geometry, level.tables, scene_.voxel_mm);
    }

    GainLaw gain_law() const override {
        const MachineGrey& grey = machine_.grey;
        return {grey.floor, grey.map == GreyMap::log ? 0 : grey.exponent, grey.dynamic_range_db,
                grey.knee, grey.knee_slope};
    }

    FrameStatus render_fast(int level,
                            const FrameRequest& request,
                            std::span<std::uint8_t> pixels,
                            std::span<EffectCost> costs) override {
        Level& at = *levels_[level];
        const PhysicalFrame frame = frame_of(request);
        if (blocks_ != nullptr) {
            const double shift_mm = norm(frame.motion.breathing_mm) +
                                    (frame.press != nullptr ? frame.press->farthest_mm() : 0);
            if (ahead_) ahead_->frame(at.reach, frame.volume_from_probe, shift_mm);
            at.reach.ensure_loaded(*blocks_, scene_.grid, frame.volume_from_probe, shift_mm);
            at.reach.ensure_loaded(scene_.words, scene_.grid, frame.volume_from_probe, shift_mm);
        }
        at.fast->render(frame, breathing_, request.input.settings.flip_left_right, keep_all_,
                        pixels);
        fill_costs(kPhysicalEffects, switches_, &at.fast->met(), at.fast->pass_ms(), costs);
        return at.fast->met().beams_in_contact == 0 ? FrameStatus::no_contact
                                                    : FrameStatus::rendered;
    }

    std::size_t pools_of(const FrameInput& input, Pools& out) const override {
        if (!scene_.has_acts || !shown_.deformation) return 0;
        const MotionState motion = motion_of(input);
        const int count = std::clamp(input.change.pool_count, 0, SceneChange::kMaxPools);
        for (int i = 0; i < count; ++i) {
            SceneChange::Pool& pool = out[static_cast<std::size_t>(i)];
            pool = input.change.pools[static_cast<std::size_t>(i)];
            pool.centre = breathed(pool.centre, motion);
        }
        return static_cast<std::size_t>(count);
    }

    void describe(RenderedFrame& rendered) const override {
        if (!reference_) levels_.front()->fast->describe(rendered);
    }

    void leave_out(int effect) override {
        switches_ = switches_without(kPhysicalEffects, chosen_, effect);
        shown_ = shown_by(switches_, machine_.structures);
    }

    void render_reference(const FrameRequest& request,
                          std::span<std::uint8_t> pixels,
                          std::span<EffectCost> costs) override {
        PassTimer timer(context_.clock);
        const Level& at = *levels_.front();
        render_physical_reference(scene_, at.geometry, at.tables, noise_, frame_of(request),
                                  pixels);
        PassTimes pass_ms{};
        pass_ms[static_cast<std::size_t>(Pass::beams)] = timer.lap_ms();
        fill_costs<PhysicalEffects, PhysicalMet>(kPhysicalEffects, switches_, nullptr, pass_ms,
                                                 costs);
    }

  private:
    // A level keeps its address: its renderer and the thread that reads ahead refer to its members.
    struct Level {
        ScanGeometry geometry;
        physical::Tables tables;
        ScanReach reach;
        std::unique_ptr<PhysicalFast> fast;  // null for the reference
    };

    MotionState motion_of(const FrameInput& input) const {
        return motion_at(exercise_.breathing, exercise_.pulsation,
                         std::isfinite(input.time_s) ? input.time_s : 0);
    }

    PhysicalFrame frame_of(const FrameRequest& request) const {
        const FrameInput& input = request.input;
        PhysicalFrame frame;
        frame.volume_from_probe = input.mannequin_from_probe;
        frame.seed = seed_;
        frame.frame = input.frame;
        frame.row_gain_db = request.row_gain_db;
        frame.dynamic_range_db = std::isfinite(input.settings.dynamic_range_db)
                                     ? std::clamp(input.settings.dynamic_range_db, 20.0, 120.0)
                                     : 60.0;
        frame.motion = motion_of(input);
        frame.motion.vein_mm =
            std::isfinite(input.change.vein_wall_mm) ? input.change.vein_wall_mm : 0;
        frame.effects = shown_;
        frame.press = shown_.deformation ? request.press : nullptr;
        std::size_t count = 0;
        if (request.needle != nullptr) needles_[count++] = *request.needle;
        if (scene_.has_acts) {
            const bool pushes = frame.press != nullptr && !frame.press->pools().empty();
            balls_of_frame(scene_, input.change, static_cast<int>(exercise_.findings.size()),
                           pushes ? &frame.volume_from_probe.rotation : nullptr, balls_);
            frame.balls = &balls_;
            frame.air = input.change.air;
            add_tube(input.change.catheter, frame, count);
            add_line(input.change.wire, shape_of(kWire, 0.7, 0.2), 0, frame, count);
        }
        frame.needles = {needles_.data(), count};
        return frame;
    }

    // Where a point at rest is now, probe frame.
    Point3 now(Point3 rest, const PhysicalFrame& frame) const {
        const Point3 p = inverse(frame.volume_from_probe) * breathed(rest, frame.motion);
        if (frame.press == nullptr) return p;
        const PlanePoint q = press::shown_point(*frame.press, {p.x, p.z});
        return {q.x, p.y, q.z};
    }
    Point3 breathed(Point3 rest, const MotionState& motion) const {
        Point3 p = rest;
        for (int step = 0; step < 4 && shown_.breathing && motion.breathes(); ++step)
            p = rest + breathing_.weight(p) * motion.breathing_mm;
        return p;
    }

    // Adds both parts of a line, beside_mm off its axis in the scan plane.
    void add_line(const SceneChange::Line& line,
                  NeedleShape shape,
                  double beside_mm,
                  const PhysicalFrame& frame,
                  std::size_t& count) const {
        if (!line.in) return;
        shape.slab_mm = std::max(exercise_.probe.elevation_mm, kMinSlabMm);
        const Point3 points[] = {now(line.from, frame), now(line.turn, frame), now(line.to, frame)};
        for (int part = 0; part < 2; ++part) {
            const Vector3 along = points[part + 1] - points[part];
            shape.length_mm = norm(along);
            if (!(shape.length_mm > shape.make->diameter_mm)) continue;
            shape.axis = along / shape.length_mm;
            // In a plane across the line its walls show one below the other.
            const Vector3 below =
                std::abs(shape.axis.z) < 0.9 ? Vector3{0, 0, 1} : Vector3{1, 0, 0};
            const Vector3 beside = normalized(below - dot(below, shape.axis) * shape.axis);
            shape.tip = points[part + 1] + beside_mm * beside;
            needles_[count++] = shape;
        }
    }
    // A catheter shows as its two walls.
    void add_tube(const SceneChange::Line& line,
                  const PhysicalFrame& frame,
                  std::size_t& count) const {
        for (const double side : {-0.5, 0.5})
            add_line(line, shape_of(kCatheterWall, 0.4, 0.1), side * kCatheterMm, frame, count);
    }

    const Exercise& exercise_;
    PhysicalScene scene_;
    const PhysicalNoise noise_;
    BreathingField breathing_;
    VoxelBlocks* const blocks_;
    const std::uint32_t seed_;
    const bool reference_, keep_all_;
    const PhysicalEffects chosen_;
    PhysicalEffects switches_, shown_;  // less what is left out; what the machine shows of them
    const RenderContext context_;
    const Machine machine_;
    std::vector<std::unique_ptr<Level>> levels_;
    std::optional<physical::OpeningGain> opening_;
    mutable std::vector<TargetBall> balls_;  // of the present frame
    mutable std::array<NeedleShape, kMaxNeedles> needles_;
    std::optional<ReadAhead> ahead_;  // ends before the levels that it refers to
};

Result<std::unique_ptr<ImageFormation>> create(const FormationInput& input) {
    constexpr int kNoiseSlack = 128;  // a block of beams and a vector beyond the last beam
    const std::shared_ptr<const PhysicalTextures> textures =
        input.options.textures ? input.options.textures : shared_physical_textures();
    JobRunner& jobs = input.context.jobs;
    PhysicalNoise noise;
    std::optional<Result<PhysicalScene>> scene;
    jobs.run(2, [&](std::size_t job) {
        if (job == 0) {  // the longer one, on the caller's thread, whose memory it keeps
            const Machine machine = machine_of(input);
            scene =
                make_physical_scene(input.bundle, shown_lesions(input.exercise),
                                    {&jobs, textures, machine.tissue_db, machine.structures,
                                     physical::shows_fine(machine, input.exercise.probe),
                                     machine.speckle_reduction.variation > 0,
                                     input.exercise.procedure.given(), input.exercise.free_fluids});
        } else {
            noise = make_physical_noise(textures->normal_levels, input.options.seed,
                                        input.scanlines + kNoiseSlack);
        }
    });
    if (!*scene) return scene->error();
    return std::unique_ptr<ImageFormation>(
        std::make_unique<PhysicalFormation>(std::move(**scene), std::move(noise), input));
}

// The slab is the beam's own thickness unless the exercise sets one.
double needle_slab_mm(const Exercise& exercise) {
    return exercise.probe.elevation_mm;
}

int scanlines(const Exercise& exercise, const RenderOptions& options) {
    return physical::beams_across(exercise.probe, chosen_machine(exercise, options));
}

int samples(const Exercise& exercise, const RenderOptions& options) {
    return physical::samples_along(exercise.probe, chosen_machine(exercise, options));
}

constexpr auto kEffectNames = effect_names_of(kPhysicalEffects);

}  // namespace

std::shared_ptr<const PhysicalTextures> shared_physical_textures() {
    return std::make_shared<const PhysicalTextures>(physical_textures());
}

const ImageModelInfo kPhysicalModel{scanlines, samples, kEffectNames, needle_slab_mm, create};

}  // namespace sonocase::runtime
