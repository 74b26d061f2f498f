// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/doppler/doppler_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "formats/base/constants.h"
#include "formats/flow/flow_field.h"
#include "formats/flow/flow_velocity.h"
#include "formats/volume/tissue.h"
#include "runtime/imaging/truth/plane_look_up.h"

namespace sonocase::runtime {
namespace {

using namespace doppler;

constexpr double kInPlaneMm = 1.5;  // the plane cuts a vessel's node that is this near
constexpr double kBreathStepS = 0.02;
constexpr double kAimSteerDeg = 20;  // steering that a machine offers to either side
// The fastest blood reaches this share of the scale that is aimed for; steps of the console.
constexpr double kAimFill = 0.75, kScaleStepCmS = 5, kMinScaleCmS = 10, kMaxScaleCmS = 500;

std::vector<std::uint8_t> hard_labels(const CaseBundle& bundle) {
    std::vector<std::uint8_t> hard;
    for (const int tissue : tissue_of_label(bundle)) {
        const TissueKind kind = bundle.tissues[tissue].kind;
        hard.push_back(kind == TissueKind::bone || kind == TissueKind::gas);
    }
    return hard;
}

// Palette index of each vessel's label; -1: it has none. "iliac_artery_right 2" is a part of the
// label iliac_artery_right.
std::vector<int> vessel_labels(const CaseBundle& bundle) {
    std::vector<int> out;
    for (const FlowVessel& vessel : bundle.flow.vessels) {
        const std::string& name = vessel.name;
        int found = -1;
        for (std::size_t i = 0; i < bundle.labels.size(); ++i) {
            const std::string& label = bundle.labels[i].name;
            if (name == label || name.rfind(label + " ", 0) == 0) found = static_cast<int>(i);
        }
        out.push_back(found);
    }
    return out;
}

double beat_s(const Exercise& exercise) {
    const double rate = exercise.pulsation.rate_per_min;
    return rate > 0 ? 60 / rate : 1;
}

// Tissue where the last frame of a renderer has it.
class ShownTissue final : public TissuePlace {
  public:
    ShownTissue(CaseView bundle,
                const Exercise& exercise,
                const MovingEffects& moves,
                const ScanGeometry& g)
        : bundle_(bundle),
          exercise_(exercise),
          breathes_(moves.breathing),
          geometry_(g),
          look_up_(
              bundle, exercise, moves.contact, moves.breathing, moves.pulsation, g, g.scanlines),
          field_(moves.breathing && exercise.breathing.amplitude_mm != 0 ? BreathingField(*bundle)
                                                                         : BreathingField()),
          hard_(hard_labels(*bundle)) {}

    void begin(const FrameInput& input, const Renderer& renderer) {
        renderer_ = &renderer;
        pose_ = renderer.shown_pose();
        input_ = &input;
        look_up_.begin(pose_, input.time_s, false, nullptr);  // the renderer presses
        const MotionState later = motion_at(breathes_ ? exercise_.breathing : BreathingMotion{}, {},
                                            input.time_s + kBreathStepS);
        const MotionState now =
            motion_at(breathes_ ? exercise_.breathing : BreathingMotion{}, {}, input.time_s);
        breath_mm_s_ = (later.breathing_mm - now.breathing_mm) / kBreathStepS;
    }

    Point3 rest(PlanePoint shown) const override {
        double line = 0, sample = 0;
        geometry_.locate(shown, line, sample);
        const double gap =
            look_up_.contact().any_gap ? look_up_.gap_at(look_up_.ray_of(line)) : 0.0;
        Point3 p = look_up_.shown(shown, gap);
        if (renderer_->press().pressed) p = renderer_->at_rest(p);
        return look_up_.without_breathing(p);
    }
    Vector3 velocity_mm_s(PlanePoint shown) const override {
        const Point3 p = pose_ * Point3{shown.x, 0, shown.z};
        const Vector3 from_face = p - (Point3{} + pose_.translation);
        Vector3 v = -input_->probe_mm_s - cross(input_->probe_rad_s, from_face);
        if (!field_.empty()) v = v + field_.weight(p) * breath_mm_s_;
        return v;
    }
    bool closed(Point3 rest) const override { return renderer_->closed(rest); }
    bool presses() const override { return renderer_->press().pressed; }
    bool blocks(PlanePoint shown) const override {
        const Point3 v = bundle_->grid.voxel_from_point(pose_ * Point3{shown.x, 0, shown.z});
        if (!(std::abs(v.x) < 1e6 && std::abs(v.y) < 1e6 && std::abs(v.z) < 1e6)) return false;
        const int i = static_cast<int>(std::floor(v.x + 0.5)),
                  j = static_cast<int>(std::floor(v.y + 0.5)),
                  k = static_cast<int>(std::floor(v.z + 0.5));
        return bundle_->grid.contains(i, j, k) && hard_[bundle_->label_bricks.at(i, j, k)] != 0;
    }
    Rigid mannequin_from_probe() const override { return pose_; }

  private:
    CaseView bundle_;
    const Exercise& exercise_;
    bool breathes_;
    const ScanGeometry& geometry_;
    PlaneLookUp look_up_;
    BreathingField field_;
    std::vector<std::uint8_t> hard_;  // # labels
    const Renderer* renderer_ = nullptr;
    const FrameInput* input_ = nullptr;
    Rigid pose_;
    Vector3 breath_mm_s_;
};

void flip_rows(std::span<std::uint8_t> plane, int width) {
    for (std::size_t at = 0; at < plane.size(); at += width) {
        const auto row = plane.subspan(at, width);
        std::reverse(row.begin(), row.end());
    }
}

}  // namespace

struct DopplerView::Impl {
    Impl(CaseView view, const Exercise& e, const RenderOptions& o, const MovingEffects& m)
        : bundle(view),
          exercise(e),
          breathes(m.breathing && e.breathing.amplitude_mm != 0),
          geometry(shown_geometry(e, o)),
          scene(view->flow, beat_s(e)),
          tissue(view, exercise, m, geometry),
          colour(scene, geometry, e.probe.frequency_mhz, e.probe.focus_mm),
          strip(scene, geometry, e.probe.frequency_mhz, o.seed),
          m_mode(geometry),
          vessel_label(vessel_labels(*view)),
          seed(o.seed),
          grey(static_cast<std::size_t>(o.width_px) * o.height_px),
          overlay(grey.size(), 0) {}

    CaseView bundle;
    Exercise exercise;
    bool breathes;
    ScanGeometry geometry;
    FlowScene scene;
    ShownTissue tissue;
    ColourImage colour;
    SpectralStrip strip;
    MMode m_mode;
    std::vector<int> vessel_label;
    DopplerMode mode = DopplerMode::off;  // of the last frame
    double cursor_deg = 0;
    std::uint32_t seed;
    std::vector<std::uint8_t> grey, overlay;
    bool painted = false;
    ColourReport report;
};

DopplerView::DopplerView(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
DopplerView::~DopplerView() = default;
DopplerView::DopplerView(DopplerView&&) noexcept = default;
DopplerView& DopplerView::operator=(DopplerView&&) noexcept = default;

Result<DopplerView> DopplerView::create(CaseView bundle,
                                        const Exercise& exercise,
                                        const RenderOptions& options) {
    SONOCASE_TRY(const MovingEffects moves, moving_effects(options));
    return DopplerView(std::make_unique<Impl>(bundle, exercise, options, moves));
}

bool DopplerView::has_flow() const {
    return !impl_->scene.empty();
}

void DopplerView::frame(const FrameInput& input,
                        const Renderer& renderer,
                        std::span<const std::uint8_t> pixels) {
    Impl& m = *impl_;
    const DopplerSettings& settings = input.settings.doppler;
    m.mode = settings.mode;
    m.cursor_deg = std::isfinite(settings.angle_deg) ? std::abs(settings.angle_deg) : 60;
    const bool box = settings.mode == DopplerMode::colour || settings.mode == DopplerMode::power;
    if (m.painted && !box) {
        std::fill(m.overlay.begin(), m.overlay.end(), std::uint8_t{0});
        m.painted = false;
    }
    if (settings.mode == DopplerMode::off || !std::isfinite(input.time_s) ||
        pixels.size() != m.grey.size())
        return;
    std::span<const std::uint8_t> grey = pixels;
    if (input.settings.flip_left_right) {
        std::copy(pixels.begin(), pixels.end(), m.grey.begin());
        flip_rows(m.grey, m.geometry.width_px);
        grey = m.grey;
    }
    const double period_s = m.breathes ? m.exercise.breathing.period_s : 0;
    if (settings.mode == DopplerMode::m_mode) {
        m.m_mode.advance(settings.gate_line, input.time_s, grey);
        return;
    }
    m.tissue.begin(input, renderer);
    if (settings.mode == DopplerMode::spectral) {
        m.strip.advance(settings, input.time_s, 60 / beat_s(m.exercise), period_s, m.tissue);
        return;
    }
    // The box is filled at the machine's own frame rate.
    const double hz = std::min(colour_frame_hz(colour_box(m.geometry, settings), settings,
                                               m.exercise.probe.frequency_mhz, m.geometry.depth_mm),
                               1e3);
    const double number = std::floor(input.time_s * hz), time_s = number / hz;
    ColourMoment moment;
    const double beats = time_s / beat_s(m.exercise);
    moment.phase = beats - std::floor(beats);
    moment.inspired = inspired_at(time_s, period_s);
    moment.frame = static_cast<std::uint32_t>(static_cast<std::int64_t>(number));
    moment.seed = m.seed;
    m.report = m.colour.render(settings, moment, m.tissue, grey, m.overlay);
    m.painted = true;
    if (input.settings.flip_left_right) flip_rows(m.overlay, m.geometry.width_px);
}

std::span<const std::uint8_t> DopplerView::overlay() const {
    return impl_->overlay;
}
const ColourReport& DopplerView::colour() const {
    return impl_->report;
}
const SpectralStrip& DopplerView::spectrum() const {
    return impl_->strip;
}
const MMode& DopplerView::m_mode() const {
    return impl_->m_mode;
}

DopplerReport DopplerView::report() const {
    const Impl& m = *impl_;
    DopplerReport out;
    if (m.mode == DopplerMode::spectral) {
        const GateContent& gate = m.strip.gate();
        const SpectralMeasures measures = m.strip.measures();
        out.on = true;
        out.cursor_deg = std::min(m.cursor_deg, 80.0);
        if (!gate.blood || gate.vessel < 0) return out;
        out.gate_label = m.vessel_label[gate.vessel];
        out.gate_fill = gate.fill;
        out.angle_deg = std::min(gate.angle_deg, 180 - gate.angle_deg);
        out.beats = measures.beats;
        out.psv_cm_s = measures.psv_cm_s;
        out.true_psv_cm_s = measures.vessel_psv_cm_s;
    }
    if (m.mode != DopplerMode::colour && m.mode != DopplerMode::power) return out;
    out.on = true;
    // Parts of one label count together.
    std::array<int, 256> cells{}, held{};
    for (std::size_t v = 0; v < m.vessel_label.size(); ++v)
        if (m.vessel_label[v] >= 0) {
            const int label = m.vessel_label[v];
            cells[label] += m.colour.shown_cells_of(static_cast<int>(v));
            held[label] += m.colour.cells_of(static_cast<int>(v));
        }
    for (std::size_t label = 0; label < cells.size(); ++label)
        if (cells[label] < DopplerReport::kColouredPart * held[label]) cells[label] = 0;
    for (int& place : out.coloured) {
        const auto largest = std::max_element(cells.begin(), cells.end());
        if (*largest < DopplerReport::kColouredCells) break;
        place = static_cast<int>(largest - cells.begin());
        *largest = 0;
    }
    return out;
}

namespace {

// Where a vessel's centre line is in the picture: its place in the plane, and how far beside it.
struct SeenNode {
    PlanePoint at;
    double off_mm = 0;
    double radius_mm = 0;
    Vector3 flow;  // unit, frame `probe`
};

SeenNode seen_node(const FlowNode& node,
                   const Rigid& probe_from_mannequin,
                   const TissuePlace* tissue) {
    const Point3 p = probe_from_mannequin * node.centre;
    SeenNode seen{{p.x, p.z},
                  p.y,
                  std::sqrt(section_area_mm2(node.radius_mm) / kPi),
                  probe_from_mannequin * node.direction};
    if (!tissue) return seen;
    // What the picture shows at a place lies elsewhere at rest; the difference changes little over
    // some millimetres, so that a few steps find the place that shows the node.
    constexpr int kSteps = 4;
    for (int i = 0; i < kSteps; ++i) {
        const Point3 there = probe_from_mannequin * tissue->rest(seen.at);
        seen.at.x += p.x - there.x;
        seen.at.z += p.z - there.z;
        seen.off_mm = p.y - there.y;
    }
    return seen;
}

SeenNode between(const SeenNode& a, const SeenNode& b, double t) {
    const auto mix = [t](double u, double v) { return u + t * (v - u); };
    return {{mix(a.at.x, b.at.x), mix(a.at.z, b.at.z)},
            mix(a.off_mm, b.off_mm),
            mix(a.radius_mm, b.radius_mm),
            normalized(a.flow + t * (b.flow - a.flow))};
}

}  // namespace

std::optional<DopplerSettings> DopplerView::aim(const FrameInput& input,
                                                DopplerSettings settings,
                                                bool steers,
                                                const Renderer* shown) const {
    Impl& m = *impl_;
    const Rigid probe_from_mannequin = inverse(input.mannequin_from_probe);
    const TissuePlace* tissue = nullptr;
    if (shown) {
        m.tissue.begin(input, *shown);
        tissue = &m.tissue;
    }
    // Bone or gas on the way from the face hides a vessel.
    const auto hidden = [&](PlanePoint at) {
        if (!tissue) return false;
        constexpr int kSteps = 60;
        const double apex = m.geometry.fan ? -m.geometry.radius_mm : at.z;
        const double from_x = m.geometry.fan ? 0 : at.x;
        const double reach = std::hypot(at.x - from_x, at.z - (m.geometry.fan ? apex : 0));
        for (int i = 1; i < kSteps; ++i) {
            const double t = double(i) / kSteps;
            if (m.geometry.fan && t * reach < m.geometry.radius_mm) continue;  // before the face
            const PlanePoint p = m.geometry.fan ? PlanePoint{t * at.x, apex + t * (at.z - apex)}
                                                : PlanePoint{at.x, t * at.z};
            if (tissue->blocks(p)) return true;
        }
        return false;
    };
    std::optional<SeenNode> widest;
    const FlowVessel *considered = nullptr, *widest_vessel = nullptr;
    const auto consider = [&](const SeenNode& node) {
        double line = 0, sample = 0;
        if ((widest && node.radius_mm <= widest->radius_mm) ||
            !m.geometry.locate(node.at, line, sample) || hidden(node.at) ||
            (tissue && tissue->closed(tissue->rest(node.at))))
            return;
        widest = node;
        widest_vessel = considered;
    };
    constexpr double kFarMm = 40;  // beyond all breathing and pressing
    for (const FlowVessel& vessel : m.bundle->flow.vessels) {
        considered = &vessel;
        SeenNode before;
        bool joined = false;  // `before` is the node before this one
        for (int i = 0; i < vessel.nodes; ++i) {
            const FlowNode& node = m.bundle->flow.nodes[vessel.first_node + i];
            if (std::abs((probe_from_mannequin * node.centre).y) > kFarMm) {
                joined = false;
                continue;
            }
            const SeenNode now = seen_node(node, probe_from_mannequin, tissue);
            // Along the plane, or across it between two nodes.
            if (std::abs(now.off_mm) < std::min(kInPlaneMm, 0.5 * now.radius_mm)) consider(now);
            if (joined && (before.off_mm < 0) != (now.off_mm < 0))
                consider(between(before, now, before.off_mm / (before.off_mm - now.off_mm)));
            before = now;
            joined = true;
        }
    }
    if (!widest) return std::nullopt;
    const PlanePoint p = widest->at;
    const Vector3 flow = widest->flow;
    const double radius = widest->radius_mm;
    const auto cosine = [&](double steer_deg) {
        DopplerSettings tried = settings;
        tried.steer_deg = steer_deg;
        const ColourBox lines = colour_box(m.geometry, tried);
        const PlanePoint beam = lines.direction(lines.line_of({p.x, p.z}));
        return std::abs(flow.x * beam.x + flow.z * beam.z);
    };
    if (steers && !m.geometry.fan)
        for (const double steer_deg : {0.0, kAimSteerDeg, -kAimSteerDeg})
            if (cosine(steer_deg) > cosine(settings.steer_deg) + 0.02)
                settings.steer_deg = steer_deg;
    const double angle = std::acos(std::min(cosine(settings.steer_deg), 1.0)) * 180 / kPi;
    const ColourBox lines = colour_box(m.geometry, settings);
    settings.gate_line = std::clamp((lines.line_of({p.x, p.z}) + 0.5) / kColourLines, 0.0, 1.0);
    settings.gate_depth_mm =
        m.geometry.fan ? std::hypot(p.x, p.z + m.geometry.radius_mm) - m.geometry.radius_mm : p.z;
    settings.gate_mm = std::clamp(2.2 * radius, 1.0, 30.0);
    // The sign turns the cursor to the side on which it lies along the vessel.
    const PlanePoint beam = lines.direction(lines.line_of({p.x, p.z}));
    const double away = flow.x * beam.x + flow.z * beam.z;
    const double side = (beam.x * flow.z - beam.z * flow.x) * (away > 0 ? 1 : -1);
    settings.angle_deg = std::copysign(std::min(angle, 80.0), side);
    const VelocityRange velocity =
        velocity_range(*widest_vessel, kPi * radius * radius, beat_s(m.exercise));
    const double fastest_cm_s = 0.1 * velocity.peak * (1 + 0.5 * widest_vessel->breathing) *
                                std::cos(std::min(angle, 80.0) * kPi / 180);
    settings.spectral_scale_cm_s =
        std::clamp(kScaleStepCmS * std::ceil(fastest_cm_s / kAimFill / kScaleStepCmS), kMinScaleCmS,
                   kMaxScaleCmS);
    settings.box_left = std::clamp(settings.gate_line - 0.25, 0.0, 0.5);
    settings.box_right = settings.box_left + 0.5;
    settings.box_top_mm = std::max(settings.gate_depth_mm - 0.25 * m.geometry.depth_mm, 2.0);
    settings.box_bottom_mm =
        std::min(settings.gate_depth_mm + 0.25 * m.geometry.depth_mm, m.geometry.depth_mm);
    return settings;
}

}  // namespace sonocase::runtime
