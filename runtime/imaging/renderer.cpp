#include "runtime/imaging/renderer.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "runtime/imaging/paper_fast.h"
#include "runtime/imaging/paper_reference.h"
#include "runtime/imaging/simd_target.h"

namespace sonocase::runtime {
namespace {

constexpr std::array<const char*, 8> kPaperEffects{
    "slice", "texture", "needle", "noise", "shadow", "blur", "attenuation", "scan_conversion"};

bool valid_pose(const Rigid& t) {
    return is_finite(t) && orthonormality_error(t.rotation) < 1e-3 && determinant(t.rotation) > 0;
}

bool finite(double x, double y, double z) {
    return std::isfinite(x) && std::isfinite(y) && std::isfinite(z);
}

}  // namespace

std::span<const char* const> effect_names(ImageModel) {
    return kPaperEffects;
}

struct Renderer::Impl {
    const CaseBundle& bundle;
    Exercise exercise;
    RenderOptions options;
    ScanGeometry geometry;
    WorkerPool workers;
    PaperScene paper_scene;
    std::unique_ptr<PaperFast> paper;
    PaperEffects effects;
    bool keep_all = false;
    std::vector<float> row_gain;
    std::vector<std::int8_t> noise_tile;
    std::vector<EffectCost> costs;

    Impl(const CaseBundle& b, const Exercise& e, const RenderOptions& o)
        : bundle(b), exercise(e), options(o), workers(o.threads) {}
};

Renderer::Renderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

Result<Renderer> Renderer::create(const CaseBundle& bundle,
                                  const Exercise& exercise,
                                  const RenderOptions& options) {
    const Probe& probe = exercise.probe;
    if (options.width_px < 1 || options.height_px < 1 || options.width_px > 8192 ||
        options.height_px > 8192) {
        return Error{"a picture of " + std::to_string(options.width_px) + " x " +
                         std::to_string(options.height_px) + " pixels",
                     "", "give 1 to 8192 pixels each way"};
    }
    if (options.threads < 1 || options.threads > 256) {
        return Error{std::to_string(options.threads) + " threads", "", "give 1 to 256"};
    }
    const double extent =
        probe.shape == ProbeShape::linear ? probe.width_mm : probe.field_of_view_rad;
    const bool radius_fits =
        probe.shape != ProbeShape::curvilinear || (probe.radius_mm > 0 && probe.radius_mm < 1e4);
    if (!(probe.depth_mm > 0 && probe.depth_mm <= 1000) || !(extent > 0) ||
        extent > (probe.shape == ProbeShape::linear ? 1000 : 6.2) || !radius_fits ||
        !(probe.frequency_mhz > 0 && probe.frequency_mhz < 100)) {
        return Error{"the probe of exercise " + exercise.name + " has no area to scan", "",
                     "depth in (0, 1000] mm, opening, radius, width and frequency above 0"};
    }
    choose_simd_target();
    auto impl = std::make_unique<Impl>(bundle, exercise, options);
    const int lines = options.scanlines > 0 ? options.scanlines : 512;
    const int samples = options.samples > 0 ? options.samples : 512;
    if (lines > 4096 || samples > 8192)
        return Error{"too many beams or samples", "", "at most 4096 x 8192"};
    impl->geometry = make_scan_geometry(probe, lines, samples, options.width_px, options.height_px);
    Result<PaperScene> scene = make_paper_scene(bundle);
    if (!scene) return scene.error();
    impl->paper_scene = std::move(*scene);
    impl->paper =
        std::make_unique<PaperFast>(impl->paper_scene, impl->geometry, options.seed, impl->workers);
    impl->row_gain.resize(static_cast<std::size_t>(samples));

    PaperEffects& on = impl->effects;
    const auto has = [&](const char* name) {
        return std::find(options.effects.begin(), options.effects.end(), name) !=
               options.effects.end();
    };
    for (const std::string& name : options.effects) {
        if (name == "auto" || name == "all" || name == "none") continue;
        if (std::find(kPaperEffects.begin(), kPaperEffects.end(), name) == kPaperEffects.end()) {
            return Error{"no effect is called " + name, "",
                         "auto, all, none, or names of the effects table"};
        }
    }
    impl->keep_all = has("all");
    if (!has("auto") && !has("all")) {
        on = {has("texture"), has("needle"),      has("noise"),
              has("shadow"),  has("attenuation"), has("blur")};
    }
    for (const char* name : kPaperEffects) impl->costs.push_back({name, 0, false, ""});
    return Renderer(std::move(impl));
}

FrameStatus Renderer::render(const FrameInput& input, std::span<std::uint8_t> pixels) {
    Impl& m = *impl_;
    assert(pixels.size() == static_cast<std::size_t>(m.options.width_px) *
                                static_cast<std::size_t>(m.options.height_px));
    if (!valid_pose(input.mannequin_from_probe)) return FrameStatus::held_bad_pose;

    const ScanGeometry& g = m.geometry;
    for (int k = 0; k < g.samples; ++k) {
        const double at = (k + 0.5) / g.samples * 7;
        const auto i = static_cast<std::size_t>(at);
        const double slider =
            input.settings.tgc_db[i] * (1 - (at - static_cast<double>(i))) +
            input.settings.tgc_db[std::min<std::size_t>(i + 1, 7)] * (at - static_cast<double>(i));
        const double db = std::clamp(input.settings.gain_db + slider, -100.0, 100.0);
        m.row_gain[static_cast<std::size_t>(k)] = static_cast<float>(std::pow(10.0, db / 20));
    }

    NeedleShape needle;
    PaperFrame frame;
    frame.volume_from_probe = input.mannequin_from_probe;
    const Vector3 d = input.needle.direction;
    if (input.has_needle && finite(input.needle.tip.x, input.needle.tip.y, input.needle.tip.z) &&
        finite(d.x, d.y, d.z) && norm(d) > 0.5) {
        const Rigid probe_from_mannequin = inverse(input.mannequin_from_probe);
        needle = needle_shape(m.exercise.needle, probe_from_mannequin * input.needle.tip,
                              normalized(probe_from_mannequin * d));
        frame.needle = &needle;
    }
    frame.seed = m.options.seed;
    frame.frame = input.frame;
    frame.row_gain = m.row_gain;
    frame.effects = m.effects;

    if (m.options.kind == RendererKind::reference) {
        const auto start = std::chrono::steady_clock::now();
        render_paper_reference(m.paper_scene, g, m.paper->noise_tile(), frame, pixels);
        if (input.settings.flip_left_right) {
            for (int row = 0; row < g.height_px; ++row) {
                const auto line = pixels.subspan(
                    static_cast<std::size_t>(row) * static_cast<std::size_t>(g.width_px),
                    static_cast<std::size_t>(g.width_px));
                std::reverse(line.begin(), line.end());
            }
        }
        for (EffectCost& c : m.costs) c = {c.name, 0, true, ""};
        m.costs[0].ms =
            std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
                .count();
    } else {
        m.paper->render(frame, input.settings.flip_left_right, m.keep_all, pixels);
        const PaperPasses& p = m.paper->passes();
        const char* off = "switched off";
        const auto set = [&](std::size_t i, double ms, bool on, const char* why) {
            m.costs[i] = {m.costs[i].name, on ? ms : 0, on, on ? "" : why};
        };
        set(0, p.beams_ms, true, "");
        set(1, 0, m.effects.texture, off);
        set(2, 0, m.effects.needle && p.needle_met,
            !m.effects.needle         ? off
            : frame.needle == nullptr ? "no needle"
                                      : "needle outside the slab");
        set(3, 0, m.effects.noise, off);
        set(4, 0, m.effects.shadow && p.shadow_met,
            !m.effects.shadow ? off : "no bone or gas crossed");
        set(5, p.blur_ms, m.effects.blur, off);
        set(6, 0, m.effects.attenuation, off);
        set(7, p.convert_ms, true, "");
    }
    return FrameStatus::rendered;
}

std::span<const EffectCost> Renderer::costs() const {
    return impl_->costs;
}

Renderer::Layout Renderer::layout() const {
    const ScanGeometry& g = impl_->geometry;
    return {g.mm_per_px, g.origin_x_px, g.origin_y_px};
}

}  // namespace sonocase::runtime
