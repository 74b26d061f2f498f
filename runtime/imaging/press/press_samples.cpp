// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_samples.h"

#include <algorithm>

#include "runtime/imaging/press/press_law.h"

namespace sonocase::runtime::press {
namespace {

constexpr double kSkinStep_mm = 2;  // no part of a body that is pressed is thinner
constexpr int kSkinSteps = static_cast<int>((kReach_mm + kSearch_mm) / kSkinStep_mm) + 1;
constexpr int kHalvings = 10;       // of such a step: 0.002 mm
constexpr double kSidePlane = 1.5;  // times half the face's height

constexpr std::array<float, kFineRows> part_middles() {
    std::array<float, kFineRows> t{};
    for (std::size_t j = 0; j < t.size(); ++j)
        t[j] = static_cast<float>((kFineEdge[j] + kFineEdge[j + 1]) / 2);
    return t;
}
constexpr std::array<float, kFineRows> kPartMiddle = part_middles();

constexpr int kSideRows = kRows * 2;
constexpr std::array<float, kSideRows> half_middles() {
    std::array<float, kSideRows> t{};
    for (int k = 0; k < kRows; ++k)
        for (int half = 0; half < 2; ++half)
            t[static_cast<std::size_t>(2 * k + half)] = static_cast<float>(
                kRowEdge[static_cast<std::size_t>(k)] + row_height(k) * (0.25 + 0.5 * half));
    return t;
}
constexpr std::array<float, kSideRows> kHalfMiddle = half_middles();

constexpr std::array<float, kSkinSteps> skin_steps() {
    std::array<float, kSkinSteps> t{};
    for (int n = 0; n < kSkinSteps; ++n)
        t[static_cast<std::size_t>(n)] = static_cast<float>(n * kSkinStep_mm - kReach_mm);
    return t;
}
constexpr std::array<float, kSkinSteps> kSkinSteps_mm = skin_steps();

// A tissue as the means take it; four numbers side by side, so that they are added at once.
struct alignas(16) Figures {
    std::array<float, 4> value{};  // stiffness, stiffness along the skin, drains, rigid
};
using FigureTable = std::array<Figures, kMaxPressTissues>;

void set_figures(std::span<const PressTissue> tissues, float scale, FigureTable& table) {
    for (std::size_t n = 0; n < tissues.size() && n < table.size(); ++n) {
        const PressTissue& t = tissues[n];
        const float stiffness = scale * t.stiffness_kpa;
        const float along = t.membrane ? static_cast<float>(kMembrane) : 1.0f;
        table[n].value = {stiffness, stiffness * along, t.drains ? 1.0f : 0.0f,
                          t.rigid ? 1.0f : 0.0f};
    }
}

struct Looker {
    const PressScene& scene;
    const FigureTable& figures;
    Vector3 shift;  // of the face, for a probe that bone has stopped

    void along(Point3 from,
               Vector3 direction,
               std::span<const float> depth,
               std::uint8_t* out) const {
        scene.lookup.along(scene.lookup.context, from + shift, direction, depth, out);
    }
    bool inside(Point3 from, Vector3 direction, float depth) const {
        std::uint8_t tissue = 0;
        along(from, direction, {&depth, 1}, &tissue);
        return !scene.tissues[tissue].outside;
    }
};

// Depth of the skin from the face, negative behind it: the first step that lies in the body, then
// halved. kSearch_mm where there is none.
double find_skin(const Looker& look, const PressBeam& beam, bool& out_of_reach) {
    std::array<std::uint8_t, kSkinSteps> tissue{};
    look.along(beam.origin, beam.direction, kSkinSteps_mm, tissue.data());
    for (std::size_t n = 0; n < kSkinSteps; ++n) {
        if (look.scene.tissues[tissue[n]].outside) continue;
        float in = kSkinSteps_mm[n];
        if (n == 0) {
            out_of_reach = true;
            return in;
        }
        float out = kSkinSteps_mm[n - 1];
        for (int halving = 0; halving < kHalvings; ++halving) {
            const float middle = (in + out) / 2;
            (look.inside(beam.origin, beam.direction, middle) ? in : out) = middle;
        }
        return in;
    }
    return kSearch_mm;
}

// Whether the body lies at the face anywhere: all that a frame costs while nothing is pressed.
bool touches(const Looker& look, const PressFace& face) {
    for (int i = kSideColumns; i < kSideColumns + kFaceColumns; ++i) {
        const PressBeam beam = press_beam(face, column_lateral_mm(face, i));
        if (look.inside(beam.origin, beam.direction, 0)) return true;
    }
    return false;
}

void sample_column(
    const Looker& look, const PressFace& face, double skin_mm, int i, PressSamples& out) {
    const double lateral = column_lateral_mm(face, i), width = column_width_mm(face);
    std::array<std::array<std::uint8_t, kFineRows>, 2> plane{};
    std::array<std::array<std::uint8_t, kSideRows>, 2> side{};
    for (int s = 0; s < 2; ++s) {
        const PressBeam beam = press_beam(face, lateral + (s - 0.5) * 0.5 * width);
        look.along(beam.origin + skin_mm * beam.direction, beam.direction, kPartMiddle,
                   plane[static_cast<std::size_t>(s)].data());
        PressBeam beside = press_beam(face, lateral);
        beside.origin.y = (2 * s - 1) * kSidePlane * face.half_height_mm;
        look.along(beside.origin + skin_mm * beside.direction, beside.direction, kHalfMiddle,
                   side[static_cast<std::size_t>(s)].data());
    }
    const auto at = static_cast<std::size_t>(i);
    out.bone_part[at] = kFineRows;
    for (int k = 0; k < kRows; ++k) {
        float along_skin = 0;
        for (int part = 0; part < kParts; ++part) {
            const int j = k * kParts + part;
            const auto row = static_cast<std::size_t>(j), half = static_cast<std::size_t>(j / 2);
            Figures sum;
            float rigid = 0;
            for (std::size_t s = 0; s < 2; ++s) {
                const std::uint8_t here = plane[s][row], there = side[s][half];
                const Figures& a = look.figures[here];
                const Figures& b = look.figures[look.scene.tissues[there].outside ? here : there];
                for (std::size_t n = 0; n < 4; ++n) sum.value[n] += a.value[n] + b.value[n];
                rigid += a.value[3];
            }
            if (rigid > 0 && j < out.bone_part[at]) out.bone_part[at] = j;
            out.stiffness_kpa.row(j)[i] = 0.25f * sum.value[0];
            const float tissue = 1 - 0.25f * sum.value[2];
            out.drains.row(j)[i] = 1 - tissue * tissue;
            out.lumen[row] = out.lumen[row] || sum.value[2] > 0;
            along_skin += sum.value[1];
        }
        out.lateral_kpa.row(k)[i] = along_skin * (0.25f / kParts);
    }
    out.fixed_row[at] = (out.bone_part[at] + kParts - 1) / kParts;
    out.bone_mm[at] = static_cast<float>(kFineEdge[static_cast<std::size_t>(out.bone_part[at])]);
}

// By how much the face lies deeper than bone lets it.
double excess_of(const PressSamples& s) {
    double excess = 0;
    for (std::size_t i = kSideColumns; i < kSideColumns + kFaceColumns; ++i)
        excess = std::max(excess, static_cast<double>(s.pressed_mm[i]) -
                                      kGreatestShare * static_cast<double>(s.bone_mm[i]));
    return excess;
}

void sample_at(const Looker& look, const PressFace& face, PressSamples& out) {
    out.lumen.fill(false);
    for (int i = 0; i < kColumns; ++i) {
        const PressBeam beam = press_beam(face, column_lateral_mm(face, i));
        const double skin = find_skin(look, beam, out.out_of_reach);
        out.pressed_mm[static_cast<std::size_t>(i)] = static_cast<float>(-skin);
        sample_column(look, face, skin, i, out);
    }
}

// Distance to where the pressed depth passes zero between columns, or to the end of the face.
void measure_edges(const PressFace& face, PressSamples& s) {
    const float width = static_cast<float>(column_width_mm(face));
    const auto sweep = [&](int first, int step) {
        float distance = 0;
        for (int n = 0; n < kFaceColumns; ++n) {
            const auto i = static_cast<std::size_t>(first + n * step);
            if (!s.touching[i]) {
                distance = 0;
                continue;
            }
            const auto before = static_cast<std::size_t>(first + (n - 1) * step);
            if (distance > 0) {
                distance += width;
            } else if (n == 0) {
                distance = width / 2;
            } else {
                const float here = s.pressed_mm[i], gap = -s.pressed_mm[before];
                distance = width * here / (here + std::max(gap, 0.0f) + 1e-6f);
            }
            const float inverse = 1 / (distance * distance + 1e-3f);
            s.edge[i] = std::max(s.edge[i], inverse);
        }
    };
    s.edge.fill(0);
    sweep(kSideColumns, 1);
    sweep(kSideColumns + kFaceColumns - 1, -1);
}

}  // namespace

void sample_tissue(const PressScene& scene,
                   const PressFace& face,
                   double stiffness_scale,
                   PressSamples& out) {
    FigureTable figures{};
    set_figures(scene.tissues, static_cast<float>(stiffness_scale), figures);
    Looker look{scene, figures, {}};
    out.out_of_reach = out.any_touch = false;
    out.excess_mm = 0;
    if (!touches(look, face)) return;
    sample_at(look, face, out);
    out.excess_mm = excess_of(out);
    if (out.excess_mm > 0 && face.radius_mm > 0) {
        // The beams of a curved face have moved over the body as well. What the bone under them
        // still lacks is small, and is taken from the pressed depth alone.
        look.shift = {0, 0, -out.excess_mm};
        sample_at(look, face, out);
        for (std::size_t i = kSideColumns; i < kSideColumns + kFaceColumns; ++i)
            out.pressed_mm[i] =
                std::min(out.pressed_mm[i], static_cast<float>(kGreatestShare) * out.bone_mm[i]);
    } else if (out.excess_mm > 0) {
        for (float& pressed : out.pressed_mm) pressed -= static_cast<float>(out.excess_mm);
    }
    out.any_touch = false;
    for (int i = 0; i < kColumns; ++i) {
        const auto at = static_cast<std::size_t>(i);
        const bool under = i >= kSideColumns && i < kSideColumns + kFaceColumns;
        out.touching[at] = under && out.pressed_mm[at] > 0;
        out.any_touch = out.any_touch || out.touching[at];
    }
    measure_edges(face, out);
}

}  // namespace sonocase::runtime::press
