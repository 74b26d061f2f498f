// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/renderer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "runtime/imaging/effects.h"
#include "runtime/imaging/governor.h"
#include "runtime/imaging/paper/paper_fast.h"
#include "runtime/imaging/physical/fast/physical_fast.h"
#include "runtime/imaging/physical/model/read_ahead.h"
#include "runtime/imaging/physical/model/scan_reach.h"
#include "runtime/imaging/simd/parallel_halves.h"
#include "runtime/imaging/simd/simd_target.h"
#include "runtime/imaging/simd/stopwatch.h"

namespace sonocase::runtime {
namespace {

constexpr int kMaxLines = 4096, kMaxSamples = 8192, kMaxPixels = 8192;

bool valid_pose(const Rigid& t) {
    return is_finite(t) && orthonormality_error(t.rotation) < 1e-3 && determinant(t.rotation) > 0;
}

bool finite(double x, double y, double z) {
    return std::isfinite(x) && std::isfinite(y) && std::isfinite(z);
}

Status check_options(const Exercise& exercise, const RenderOptions& o) {
    const Probe& p = exercise.probe;
    if (o.width_px < 1 || o.height_px < 1 || o.width_px > kMaxPixels || o.height_px > kMaxPixels) {
        return Error{"a picture of " + std::to_string(o.width_px) + " x " +
                         std::to_string(o.height_px) + " pixels",
                     "", "give 1 to 8192 pixels each way"};
    }
    if (o.threads < 1 || o.threads > 256)
        return Error{std::to_string(o.threads) + " threads", "", "give 1 to 256"};
    if (o.scanlines < 0 || o.scanlines > kMaxLines || o.samples < 0 || o.samples > kMaxSamples) {
        return Error{
            std::to_string(o.scanlines) + " beams of " + std::to_string(o.samples) + " samples", "",
            "give at most 4096 x 8192"};
    }
    const bool linear = p.shape == ProbeShape::linear;
    const double extent = linear ? p.width_mm : p.field_of_view_rad;
    const bool radius_fits =
        p.shape != ProbeShape::curvilinear || (p.radius_mm > 0 && p.radius_mm < 1e4);
    if (!(p.depth_mm > 0 && p.depth_mm <= 1000) ||
        !(extent > 0 && extent <= (linear ? 1000 : 6.2)) || !radius_fits ||
        !(p.frequency_mhz > 0.1 && p.frequency_mhz < 100) || !std::isfinite(p.focus_mm) ||
        !(p.elevation_mm >= 0 && p.elevation_mm < 100)) {
        return Error{"the probe of exercise " + exercise.name + " has no area to scan", "",
                     "give depth in (0, 1000] mm, opening, radius, width and frequency above 0"};
    }
    return Done{};
}

}  // namespace

struct Renderer::Impl {
    // One accuracy: its beams and the buffers that go with them.
    struct Level {
        ScanGeometry geometry;
        std::vector<float> row_gain, row_gain_db;  // # samples
        physical::Tables tables;
        std::unique_ptr<PaperFast> paper;
        std::unique_ptr<PhysicalFast> physical;
        ScanReach reach;
    };
    std::vector<std::unique_ptr<Level>> levels;  // finest first; one without a frame budget
    Governor governor;
    Level& now() { return *levels[static_cast<std::size_t>(governor.level())]; }

    CaseView bundle;
    Exercise exercise;
    RenderOptions options;
    WorkerPool workers;
    EffectChoice effects;
    std::vector<EffectCost> costs;

    PaperScene paper_scene;

    PhysicalScene physical_scene;
    PhysicalNoise noise;
    BreathingField breathing;
    std::optional<ReadAhead> ahead;  // ends before what it looks at

    Impl(CaseView b, const Exercise& e, const RenderOptions& o)
        : bundle(b), exercise(e), options(o), workers(o.threads) {}

    void set_gain(const ImageSettings& settings);
    FrameStatus render_paper(const FrameInput& input,
                             const NeedleShape* needle,
                             std::span<std::uint8_t> pixels);
    FrameStatus render_physical(const FrameInput& input,
                                const NeedleShape* needle,
                                std::span<std::uint8_t> pixels);
    void flip(std::span<std::uint8_t> pixels) const;

    // The slow renderer knows one pass. on(entry): the effect is not switched off.
    template <class Draw, class On>
    FrameStatus by_reference(const FrameInput& input,
                             std::span<std::uint8_t> pixels,
                             Draw&& draw,
                             On&& on) {
        const auto start = std::chrono::steady_clock::now();
        draw();
        if (input.settings.flip_left_right) flip(pixels);
        const std::array<double, 6> passes{0, milliseconds_since(start), 0, 0, 0, 0};
        set_costs(passes, [&](const EffectEntry& e) { return on(e) ? "" : "switched off"; });
        return FrameStatus::rendered;
    }

    // Shares the time of each pass among its effects that ran. `skipped` says why an effect did
    // not, or
    // "" where it did.
    template <class Skipped>
    void set_costs(std::span<const double> pass_ms, Skipped&& skipped) {
        const auto table = effect_table(options.model);
        std::array<double, 6> total{};
        for (std::size_t i = 0; i < table.size(); ++i) {
            const char* why = skipped(table[i]);
            costs[i] = {table[i].name, 0, *why == '\0', why};
            if (costs[i].ran) total[static_cast<std::size_t>(table[i].pass)] += table[i].weight;
        }
        for (std::size_t i = 0; i < table.size(); ++i) {
            const auto pass = static_cast<std::size_t>(table[i].pass);
            if (costs[i].ran) costs[i].ms = pass_ms[pass] * table[i].weight / total[pass];
        }
    }
};

Renderer::Renderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

Result<Renderer> Renderer::create(CaseView bundle,
                                  const Exercise& exercise,
                                  const RenderOptions& options) {
    if (const Status fits = check_options(exercise, options); !fits) return fits.error();
    choose_simd_target();
    auto impl = std::make_unique<Impl>(bundle, exercise, options);
    Impl& m = *impl;
    VoxelBlocks* const blocks = bundle.blocks();
    if (blocks && options.kind == RendererKind::reference) blocks->load_all(serial_jobs());
    Result<EffectChoice> effects = choose_effects(options.model, options.effects);
    if (!effects) return effects.error();
    m.effects = *effects;
    const bool is_paper = options.model == ImageModel::paper;
    const int lines = options.scanlines > 0 ? options.scanlines : is_paper ? 512 : 192;
    const int samples = options.samples > 0 ? options.samples : 512;
    if (is_paper) {
        Result<PaperScene> scene = make_paper_scene(*bundle);
        if (!scene) return scene.error();
        m.paper_scene = std::move(*scene);
    } else {
        std::optional<Result<PhysicalScene>> scene;
        parallel_halves(2, [&](std::size_t half, std::size_t, std::size_t) {
            if (half == 0) {
                m.noise = make_physical_noise(options.seed, lines + 128);
            } else {
                scene = make_physical_scene(bundle, exercise.targets);
            }
        });
        if (!*scene) return scene->error();
        m.physical_scene = std::move(**scene);
        if (exercise.breathing.amplitude_mm != 0) m.breathing = BreathingField(*bundle);
    }
    const bool governed = options.frame_budget_ms > 0 && options.kind == RendererKind::fast;
    m.governor = Governor(governed ? options.frame_budget_ms : 0);
    for (const AccuracyLevel& accuracy : kAccuracyLevels) {
        auto level = std::make_unique<Impl::Level>();
        const int l = std::max(1, static_cast<int>(lines * accuracy.lines)),
                  k = std::max(1, static_cast<int>(samples * accuracy.samples));
        level->geometry =
            make_scan_geometry(exercise.probe, l, k, options.width_px, options.height_px);
        level->row_gain.assign(static_cast<std::size_t>(k), 1.0f);
        level->row_gain_db.assign(static_cast<std::size_t>(k), 0.0f);
        level->tables = physical::make_tables(exercise.probe, level->geometry);
        if (is_paper) {
            level->paper = std::make_unique<PaperFast>(m.paper_scene, level->geometry, options.seed,
                                                       m.workers);
        } else if (options.kind == RendererKind::fast) {
            level->physical = std::make_unique<PhysicalFast>(m.physical_scene, level->geometry,
                                                             level->tables, m.noise, m.workers);
            level->reach = ScanReach(level->geometry, level->tables, m.physical_scene.voxel_mm);
        }
        m.levels.push_back(std::move(level));
        if (!governed) break;
    }
    if (options.read_ahead && blocks && m.levels.front()->physical)
        m.ahead.emplace(*blocks, bundle->grid);
    for (const EffectEntry& e : effect_table(options.model))
        m.costs.push_back({e.name, 0, false, ""});
    return Renderer(std::move(impl));
}

void Renderer::Impl::set_gain(const ImageSettings& s) {
    const ScanGeometry& geometry = now().geometry;
    std::vector<float>& row_gain_db = now().row_gain_db;
    for (int k = 0; k < geometry.samples; ++k) {
        const double at = (k + 0.5) / geometry.samples * 7;  // eight sliders, linear in between
        const auto i = static_cast<std::size_t>(at);
        const double slider =
            s.tgc_db[i] * (1 - (at - static_cast<double>(i))) +
            s.tgc_db[std::min<std::size_t>(i + 1, 7)] * (at - static_cast<double>(i));
        const double db = s.gain_db + slider;
        row_gain_db[static_cast<std::size_t>(k)] =
            static_cast<float>(std::isfinite(db) ? std::clamp(db, -100.0, 100.0) : 0.0);
    }
}

void Renderer::Impl::flip(std::span<std::uint8_t> pixels) const {
    const auto width = static_cast<std::size_t>(options.width_px);
    for (std::size_t row = 0; row < pixels.size(); row += width) {
        const auto line = pixels.subspan(row, width);
        std::reverse(line.begin(), line.end());
    }
}

FrameStatus Renderer::Impl::render_paper(const FrameInput& input,
                                         const NeedleShape* needle,
                                         std::span<std::uint8_t> pixels) {
    Level& at = now();
    const ScanGeometry& geometry = at.geometry;
    std::vector<float>&row_gain = at.row_gain, &row_gain_db = at.row_gain_db;
    PaperFast* paper = at.paper.get();
    for (std::size_t k = 0; k < row_gain.size(); ++k) {
        row_gain[k] =
            row_gain_db[k] == 0
                ? 1.0f
                : static_cast<float>(std::pow(10.0, static_cast<double>(row_gain_db[k]) / 20));
    }
    PaperFrame frame;
    frame.volume_from_probe = input.mannequin_from_probe;
    frame.needle = needle;
    frame.seed = options.seed;
    frame.frame = input.frame;
    frame.row_gain = row_gain;
    frame.effects = effects.paper;
    if (options.kind == RendererKind::reference) {
        return by_reference(
            input, pixels,
            [&] {
                render_paper_reference(paper_scene, geometry, paper->noise_tile(), frame, pixels);
            },
            [&](const EffectEntry& e) { return e.paper == nullptr || effects.paper.*e.paper; });
    }
    paper->render(frame, input.settings.flip_left_right, effects.keep_all, pixels);
    const PaperPasses& p = paper->passes();
    const std::array<double, 6> passes{0, p.beams_ms, p.needle_ms, p.blur_ms, 0, p.convert_ms};
    set_costs(passes, [&](const EffectEntry& e) {
        if (e.paper != nullptr && !(effects.paper.*e.paper)) return "switched off";
        if (e.paper == &PaperEffects::shadow && !p.shadow_met) return "no bone or gas crossed";
        if (e.paper == &PaperEffects::needle && needle == nullptr) return "no needle";
        if (e.paper == &PaperEffects::needle && !p.needle_met) return "needle outside the slab";
        return "";
    });
    return FrameStatus::rendered;
}

FrameStatus Renderer::Impl::render_physical(const FrameInput& input,
                                            const NeedleShape* needle,
                                            std::span<std::uint8_t> pixels) {
    Level& at = now();
    const ScanGeometry& geometry = at.geometry;
    const physical::Tables& tables = at.tables;
    const std::vector<float>& row_gain_db = at.row_gain_db;
    PhysicalFast* physical = at.physical.get();
    PhysicalFrame frame;
    frame.volume_from_probe = input.mannequin_from_probe;
    frame.needle = needle;
    frame.seed = options.seed;
    frame.frame = input.frame;
    frame.row_gain_db = row_gain_db;
    frame.dynamic_range_db = std::isfinite(input.settings.dynamic_range_db)
                                 ? std::clamp(input.settings.dynamic_range_db, 20.0, 120.0)
                                 : 60.0;
    frame.motion = motion_at(exercise.breathing, exercise.pulsation,
                             std::isfinite(input.time_s) ? input.time_s : 0);
    frame.effects = effects.physical;
    if (options.kind == RendererKind::reference) {
        return by_reference(
            input, pixels,
            [&] {
                render_physical_reference(physical_scene, geometry, tables, noise, frame, pixels);
            },
            [&](const EffectEntry& e) {
                return e.physical == nullptr || effects.physical.*e.physical;
            });
    }
    if (VoxelBlocks* blocks = bundle.blocks()) {
        const double shift_mm = norm(frame.motion.breathing_mm);
        if (ahead) ahead->frame(at.reach, frame.volume_from_probe, shift_mm);
        at.reach.ensure_loaded(*blocks, bundle->grid, frame.volume_from_probe, shift_mm);
        at.reach.ensure_loaded(physical_scene.words, bundle->grid, frame.volume_from_probe,
                               shift_mm);
    }
    physical->render(frame, breathing, input.settings.flip_left_right, effects.keep_all, pixels);
    const PhysicalPasses& p = physical->passes();
    const std::array<double, 6> passes{p.contact_ms, p.beams_ms, p.needle_ms,
                                       p.filter_ms,  p.grey_ms,  p.convert_ms};
    using Y = PhysicalEffects;
    set_costs(passes, [&](const EffectEntry& e) {
        if (e.physical == nullptr) return "";
        if (!(effects.physical.*e.physical)) return "switched off";
        if (e.physical == &Y::breathing && !frame.motion.breathes())
            return "the scenario does not breathe, or is at rest";
        if (e.physical == &Y::pulsation && frame.motion.pulse_mm == 0) return "no pulse";
        if ((e.physical == &Y::boundaries || e.physical == &Y::interfaces) && !p.boundary_met)
            return "no interface crossed";
        if (e.physical == &Y::edge_shadow && !p.refraction_met) return "no fluid crossed";
        if ((e.physical == &Y::bone_tail || e.physical == &Y::gas_ring_down) && !p.hard_met)
            return "no bone or gas crossed";
        if (e.physical == &Y::needle && needle == nullptr) return "no needle";
        if (e.physical == &Y::needle && !p.needle_met) return "needle outside the slab";
        if (e.physical == &Y::fine_structure && !p.fine_met) return "no muscle or fat crossed";
        if (e.physical == &Y::targets && !p.target_met) return "no target near the slab";
        if (e.physical == &Y::contact && !p.gap_met) return "the probe touches everywhere";
        if (e.physical == &Y::structure && !physical_scene.words.has_echo())
            return "the bundle holds no structure";
        return "";
    });
    return p.beams_in_contact == 0 ? FrameStatus::no_contact : FrameStatus::rendered;
}

FrameStatus Renderer::render(const FrameInput& input, std::span<std::uint8_t> pixels) {
    Impl& m = *impl_;
    assert(pixels.size() == static_cast<std::size_t>(m.options.width_px) *
                                static_cast<std::size_t>(m.options.height_px));
    if (!valid_pose(input.mannequin_from_probe)) return FrameStatus::held_bad_pose;
    m.set_gain(input.settings);
    NeedleShape needle;
    const NeedleShape* shown = nullptr;
    const Vector3 d = input.needle.direction;
    const Point3 tip = input.needle.tip;
    if (input.has_needle && finite(tip.x, tip.y, tip.z) && finite(d.x, d.y, d.z) && norm(d) > 0.5) {
        const Rigid probe_from_mannequin = inverse(input.mannequin_from_probe);
        NeedleModel model = m.exercise.needle;
        // The physical slab is the beam's own thickness unless the exercise sets one.
        if (m.options.model == ImageModel::physical && !(model.slab_mm > 0))
            model.slab_mm = m.exercise.probe.elevation_mm;
        needle =
            needle_shape(model, probe_from_mannequin * tip, normalized(probe_from_mannequin * d));
        if (needle.radius_mm > 0 && std::isfinite(needle.slab_mm)) shown = &needle;
    }
    const auto start = std::chrono::steady_clock::now();
    const FrameStatus status = m.options.model == ImageModel::paper
                                   ? m.render_paper(input, shown, pixels)
                                   : m.render_physical(input, shown, pixels);
    m.governor.frame_took(milliseconds_since(start));
    return status;
}

std::span<const EffectCost> Renderer::costs() const {
    return impl_->costs;
}

Renderer::Accuracy Renderer::accuracy() const {
    const ScanGeometry &g = impl_->now().geometry, &full = impl_->levels.front()->geometry;
    return {impl_->governor.level(),
            static_cast<int>(impl_->levels.size()),
            g.scanlines,
            g.samples,
            full.scanlines,
            full.samples};
}

Renderer::Layout Renderer::layout() const {
    const ScanGeometry& g = impl_->levels.front()->geometry;
    return {g.mm_per_px, g.origin_x_px, g.origin_y_px};
}

}  // namespace sonocase::runtime
