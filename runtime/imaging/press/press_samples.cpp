// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_samples.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "press_samples.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// This comes after Highway's: it is included again for each instruction set.
#include "runtime/imaging/press/press_law-inl.h"

#ifndef SONOCASE_PRESS_SAMPLES_ONCE
#define SONOCASE_PRESS_SAMPLES_ONCE
namespace sonocase::runtime::press {

// A tissue's figures in one word: its stiffness, whose four lowest bits (a millionth of it) hold
// the flags.
inline constexpr std::int32_t kDrainsBit = 1, kRigidBit = 2, kOutsideBit = 4, kMembraneBit = 8;
using FigureTable = std::array<std::int32_t, kMaxPressTissues>;

}  // namespace sonocase::runtime::press
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::press::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Lanes = hn::CappedTag<float, 16>;

// Takes the means of every cell over the tissues that were looked up: two places in the plane, and
// one each in front of it and behind it.
void average(const FigureTable& figures, PressSamples& out) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const hn::Rebind<std::uint8_t, Lanes> d8;
    const auto one = hn::Set(d, 1.0f), quarter = hn::Set(d, 0.25f);
    const auto stiff = hn::Set(di, ~15), once = hn::Set(di, 1);
    const auto membrane = hn::Set(d, static_cast<float>(kMembrane));
    const auto figure_at = [&](std::size_t which, int row, int i) HWY_ATTR {
        const std::uint8_t* tissue = out.tissue[which].data() + row * kColumns + i;
        return hn::GatherIndex(di, figures.data(), hn::PromoteTo(di, hn::LoadU(d8, tissue)));
    };
    std::array<std::int32_t, kColumns> bone{};
    bone.fill(kFineRows);
    for_columns(d, [&](int i) HWY_ATTR {
        auto first_bone = hn::Set(di, kFineRows);
        for (int k = 0; k < kRows; ++k) {
            auto along_skin = hn::Zero(d);
            auto drains = hn::Zero(di), rigid = hn::Zero(di);
            for (int part = 0; part < kParts; ++part) {
                const int j = k * kParts + part;
                auto sum = hn::Zero(d);
                drains = hn::Zero(di);
                rigid = hn::Zero(di);
                for (std::size_t s = 0; s < 2; ++s) {
                    const auto here = figure_at(s, j, i), beside = figure_at(2 + s, j, i);
                    const auto counted =
                        hn::IfThenElse(hn::TestBit(beside, hn::Set(di, kOutsideBit)), here, beside);
                    rigid = hn::Or(rigid, here);
                    for (const auto figure : {here, counted}) {
                        const auto kpa = hn::BitCast(d, hn::And(figure, stiff));
                        sum = hn::Add(sum, kpa);
                        const auto skin = hn::TestBit(figure, hn::Set(di, kMembraneBit));
                        along_skin = hn::Add(
                            along_skin,
                            hn::IfThenElse(hn::RebindMask(d, skin), hn::Mul(kpa, membrane), kpa));
                        drains = hn::Add(drains, hn::And(figure, once));
                    }
                }
                hn::StoreU(hn::Mul(quarter, sum), d, out.stiffness_kpa.row(j) + i);
                const auto tissue = hn::Sub(one, hn::Mul(quarter, hn::ConvertTo(d, drains)));
                hn::StoreU(hn::Sub(one, hn::Mul(tissue, tissue)), d, out.drains.row(j) + i);
                if (!hn::AllTrue(di, hn::Eq(drains, hn::Zero(di)))) out.lumen[j] = true;
                const auto hard = hn::TestBit(rigid, hn::Set(di, kRigidBit));
                first_bone = hn::IfThenElse(hard, hn::Min(first_bone, hn::Set(di, j)), first_bone);
            }
            hn::StoreU(hn::Mul(along_skin, hn::Set(d, 0.25f / kParts)), d,
                       out.lateral_kpa.row(k) + i);
        }
        hn::StoreU(first_bone, di, bone.data() + i);
    });
    for (std::size_t i = 0; i < kColumns; ++i) {
        out.bone_part[i] = bone[i];
        out.fixed_row[i] = (bone[i] + kParts - 1) / kParts;
        out.bone_mm[i] = static_cast<float>(kFineEdge[bone[i]]);
    }
}

}  // namespace sonocase::runtime::press::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime::press {

HWY_EXPORT(average);

namespace {

constexpr double kSkinStepMm = 2;  // no part of a body that can be pressed is thinner
constexpr int kSkinSteps = static_cast<int>((kReachMm + kSearchMm) / kSkinStepMm) + 1;
constexpr int kFinerSteps = 8;      // parts of such a step
constexpr int kFinerLevels = 4;     // times that a step is divided: down to 0.0005 mm
constexpr double kSidePlane = 1.5;  // distance of the side planes over half the face's height

template <std::size_t kCount>
constexpr std::array<float, kCount> evenly(double first, double step) {
    std::array<float, kCount> t{};
    for (std::size_t n = 0; n < kCount; ++n)
        t[n] = static_cast<float>(first + static_cast<double>(n) * step);
    return t;
}
constexpr auto kSkinDepthMm = evenly<kSkinSteps>(-kReachMm, kSkinStepMm);

constexpr std::array<float, kFineRows> part_middles() {
    std::array<float, kFineRows> t{};
    for (std::size_t j = 0; j < t.size(); ++j)
        t[j] = static_cast<float>((kFineEdge[j] + kFineEdge[j + 1]) / 2);
    return t;
}
constexpr std::array<float, kFineRows> kPartMiddle = part_middles();

void set_figures(std::span<const PressTissue> tissues, float scale, FigureTable& table) {
    for (std::size_t n = 0; n < tissues.size() && n < table.size(); ++n) {
        const PressTissue& t = tissues[n];
        const auto bits = std::bit_cast<std::int32_t>(scale * t.stiffness_kpa) & ~15;
        table[n] = bits | (t.drains ? kDrainsBit : 0) | (t.rigid ? kRigidBit : 0) |
                   (t.outside ? kOutsideBit : 0) | (t.membrane ? kMembraneBit : 0);
    }
}

using Lines = std::array<PressLine, kColumns>;
using SkinDepths = std::array<double, kColumns>;

// Looks up tissue under a face.
struct TissueReader {
    const PressScene& scene;
    Vector3 shift;  // shift of the face, for a probe that bone has stopped

    void along(Lines lines, std::span<const float> depth, std::uint8_t* out) const {
        for (PressLine& line : lines) line.from = line.from + shift;
        scene.lookup.along(scene.lookup.context, lines, depth, out);
    }
    void refine_skin(Lines lines, SkinDepths& skin) const {
        for (PressLine& line : lines) line.from = line.from + shift;
        scene.lookup.refine_skin(scene.lookup.context, lines, skin);
    }
    bool outside(std::uint8_t tissue) const { return scene.tissues[tissue].outside; }
};

Lines lines_of(const ColumnBeams& beams) {
    Lines lines;
    for (std::size_t i = 0; i < kColumns; ++i) lines[i] = {beams[i].origin, beams[i].direction};
    return lines;
}

// Finds the depth of the skin from the face, negative behind it: the first step that lies in the
// body, then the first of its parts. kSearchMm where there is none.
void find_skin(const TissueReader& reader,
               const Lines& lines,
               SkinDepths& skin,
               bool& out_of_reach) {
    std::array<std::uint8_t, std::size_t{kSkinSteps} * kColumns> tissue{};
    const auto first_inside = [&](std::size_t steps, std::size_t column) {
        std::size_t n = 0;
        while (n < steps && reader.outside(tissue[n * kColumns + column])) ++n;
        return n;
    };
    std::array<bool, kColumns> found_end{};  // the skin lies beyond the first or the last step
    // Several steps at a time: most columns meet the body long before the last one.
    constexpr std::size_t kTogether = 9;
    static_assert(kSkinSteps % kTogether == 0);
    std::array<std::size_t, kColumns> met{};
    for (std::size_t from = 0; from < kSkinSteps; from += kTogether) {
        reader.along(lines, std::span(kSkinDepthMm).subspan(from, kTogether),
                     tissue.data() + from * kColumns);
        bool all = true;
        for (std::size_t i = 0; i < kColumns; ++i) {
            while (met[i] < from + kTogether && reader.outside(tissue[met[i] * kColumns + i]))
                ++met[i];
            all = all && met[i] < from + kTogether;
        }
        if (all) break;
    }
    for (std::size_t i = 0; i < kColumns; ++i) {
        const std::size_t n = met[i];
        found_end[i] = n == 0 || n == kSkinSteps;
        out_of_reach = out_of_reach || n == 0;
        skin[i] = n == kSkinSteps ? kSearchMm : static_cast<double>(kSkinDepthMm[n]);
    }
    double step = kSkinStepMm;
    for (int level = 0; level < kFinerLevels; ++level) {
        // Starts at the last place that is known to lie outside; the end of the step lies inside.
        Lines from = lines;
        for (std::size_t i = 0; i < kColumns; ++i)
            from[i].from = from[i].from + (skin[i] - step) * from[i].direction;
        const double finer = step / kFinerSteps;
        const auto depth = evenly<kFinerSteps - 1>(finer, finer);
        reader.along(from, depth, tissue.data());
        for (std::size_t i = 0; i < kColumns; ++i) {
            if (found_end[i]) continue;
            const std::size_t n = first_inside(depth.size(), i);
            skin[i] += static_cast<double>(n + 1) * finer - step;
        }
        step = finer;
    }
    if (reader.scene.lookup.refine_skin == nullptr) return;
    SkinDepths found = skin;
    for (std::size_t i = 0; i < kColumns; ++i)
        if (found_end[i]) found[i] = std::numeric_limits<double>::quiet_NaN();
    reader.refine_skin(lines, found);
    for (std::size_t i = 0; i < kColumns; ++i)
        if (!found_end[i]) skin[i] = found[i];
}

// Whether the body lies at the face anywhere. This is all that a frame costs while nothing is
// pressed.
bool touches(const TissueReader& reader, const Lines& lines) {
    std::array<std::uint8_t, kFaceColumns> tissue{};
    constexpr float kFace = 0;
    reader.scene.lookup.along(reader.scene.lookup.context,
                              std::span(lines).subspan(kSideColumns, kFaceColumns), {&kFace, 1},
                              tissue.data());
    return std::any_of(tissue.begin(), tissue.end(),
                       [&](std::uint8_t t) { return !reader.outside(t); });
}

// How much deeper the face lies than bone lets it; only tissue of the scan plane counts, and only
// parts that are near enough to stop the face are examined.
double excess_of(const FigureTable& figures, const PressSamples& s) {
    double excess = 0;
    for (std::size_t i = kSideColumns; i < kSideColumns + kFaceColumns; ++i) {
        const auto pressed = static_cast<double>(s.pressed_mm[i]);
        for (std::size_t j = 0; j < kFineRows; ++j) {
            const double beyond = pressed - kMaxShare * kFineEdge[j];
            if (beyond <= excess) break;
            const std::size_t at = j * kColumns + i;
            if (((figures[s.tissue[0][at]] | figures[s.tissue[1][at]]) & kRigidBit) == 0) continue;
            excess = beyond;
            break;
        }
    }
    return excess;
}

// Finds the skin and the tissue of the scan plane.
void sample_plane(const TissueReader& reader,
                  const PressBeams& beams,
                  SkinDepths& skin,
                  PressSamples& out) {
    find_skin(reader, lines_of(beams.middle), skin, out.out_of_reach);
    for (std::size_t i = 0; i < kColumns; ++i) out.pressed_mm[i] = static_cast<float>(-skin[i]);
    for (std::size_t s = 0; s < 2; ++s) {
        Lines plane = lines_of(s == 0 ? beams.left : beams.right);
        for (std::size_t i = 0; i < kColumns; ++i)
            plane[i].from = plane[i].from + skin[i] * plane[i].direction;
        reader.along(plane, kPartMiddle, out.tissue[s].data());
    }
}

// Finds the tissue beside the plane, then the means.
void sample_beside(SimdTarget simd,
                   const TissueReader& reader,
                   const PressFace& face,
                   const PressBeams& beams,
                   const SkinDepths& skin,
                   const FigureTable& figures,
                   PressSamples& out) {
    for (std::size_t s = 0; s < 2; ++s) {
        Lines beside = lines_of(beams.middle);
        for (std::size_t i = 0; i < kColumns; ++i) {
            beside[i].from = beside[i].from + skin[i] * beside[i].direction;
            beside[i].from.y = (s == 0 ? -kSidePlane : kSidePlane) * face.half_height_mm;
        }
        reader.along(beside, kPartMiddle, out.tissue[2 + s].data());
    }
    out.lumen.fill(false);
    HWY_DISPATCH_TABLE(average)[simd.index](figures, out);
}

// Finds the distance to where the pressed depth passes zero between columns, or to the end of the
// face.
void measure_edges(const PressFace& face, PressSamples& s) {
    const float width = static_cast<float>(column_width_mm(face));
    const auto sweep = [&](int first, int step) {
        float distance = 0;
        for (int n = 0; n < kFaceColumns; ++n) {
            const int i = first + n * step;
            if (!s.touching[i]) {
                distance = 0;
                continue;
            }
            const int before = first + (n - 1) * step;
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

void sample_tissue(SimdTarget simd,
                   const PressScene& scene,
                   const PressFace& face,
                   const PressBeams& beams,
                   double stiffness_scale,
                   PressSamples& out) {
    FigureTable figures{};
    set_figures(scene.tissues, static_cast<float>(stiffness_scale), figures);
    TissueReader reader{scene, {}};
    out.out_of_reach = out.any_touch = false;
    out.excess_mm = 0;
    if (!touches(reader, lines_of(beams.middle))) return;
    SkinDepths skin{};
    sample_plane(reader, beams, skin, out);
    out.excess_mm = excess_of(figures, out);
    const bool again = out.excess_mm > 0 && face.radius_mm > 0;
    if (again) {
        // The beams of a curved face have moved over the body too. What is still missing above the
        // bone is small, and only the pressed depth is corrected for it.
        reader.shift = {0, 0, -out.excess_mm};
        sample_plane(reader, beams, skin, out);
    }
    sample_beside(simd, reader, face, beams, skin, figures, out);
    if (again) {
        for (std::size_t i = kSideColumns; i < kSideColumns + kFaceColumns; ++i)
            out.pressed_mm[i] =
                std::min(out.pressed_mm[i], static_cast<float>(kMaxShare) * out.bone_mm[i]);
    } else if (out.excess_mm > 0) {
        for (float& pressed : out.pressed_mm) pressed -= static_cast<float>(out.excess_mm);
    }
    out.any_touch = false;
    for (int i = 0; i < kColumns; ++i) {
        const bool under = i >= kSideColumns && i < kSideColumns + kFaceColumns;
        out.touching[i] = under && out.pressed_mm[i] > 0;
        out.any_touch = out.any_touch || out.touching[i];
    }
    measure_edges(face, out);
}

}  // namespace sonocase::runtime::press
#endif
