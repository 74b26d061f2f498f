// SPDX-License-Identifier: Apache-2.0

// Anatomy for scores and events: whether a point is inside the body, in which structure, and where
// breathing moves it. Skin, and therefore the inserted length, stays at rest, because the mannequin
// does not breathe.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/motion.h"
#include "formats/volume/surface.h"

namespace sonocase {

class Anatomy {
  public:
    virtual ~Anatomy() = default;
    virtual bool inside(Point3 p) const = 0;
    // Palette index at a point; 0 outside. If structures are unknown, 1 everywhere inside.
    virtual int label(Point3 p) const { return inside(p) ? 1 : 0; }
    // Distance from `from` (inside) along the unit vector `direction` to where the body ends;
    // `reach` if it does not end before. Short gaps labelled outside do not end it.
    virtual double exit_distance(Point3 from, Vector3 direction, double reach) const = 0;
    // The place at rest of the tissue that is now at p, and the place now of the tissue that is at
    // `rest` when at rest; at most greatest_shift_mm() apart.
    Point3 at_rest(Point3 p, double time_s) const { return at_rest(p, breath_mm(time_s)); }
    // The same where many points of one moment are asked for: breath_mm() is what moves wholly.
    virtual Vector3 breath_mm(double /*time_s*/) const { return {}; }
    virtual Point3 at_rest(Point3 p, Vector3 /*breath_mm*/) const { return p; }
    virtual Point3 moved(Point3 rest, double /*time_s*/) const { return rest; }
    virtual double greatest_shift_mm() const { return 0; }
    // True if labels say where sound passes, so that blocks_sound() and shadows are defined.
    virtual bool knows_tissue() const { return false; }
    virtual bool blocks_sound(int /*label*/) const { return false; }  // bone or gas
    // What sound loses in the tissue of a label, one way, dB/cm/MHz, as pictures show it; and the
    // amplitude of its echo relative to a homogeneous liver.
    struct Acoustics {
        double loss_db_cm_mhz = 0.5, echo = 1;
        bool bone = false, gas = false;
    };
    virtual Acoustics acoustics(int label) const {
        if (label == 0) return {0, 0};
        return blocks_sound(label) ? Acoustics{20, 1, true} : Acoustics{};
    }
    // True where the volume cuts the body off: a surface there is not skin.
    virtual bool at_edge(Point3 /*p*/) const { return false; }
};

// The cooked labels: a voxel's own label, or the second one beyond its boundary plane; the renderer
// uses the same rule. The bundle must outlive this object. inside() and label() are constant time
// and allocate nothing; exit_distance() makes reach / (half a voxel) such look-ups.
class CaseAnatomy final : public Anatomy {
  public:
    // breathing: as the picture shows it; none by default. Cost: one look-up per brick.
    explicit CaseAnatomy(CaseView bundle, const BreathingMotion& breathing = {});
    bool inside(Point3 p) const override { return label(p) != 0; }
    int label(Point3 p) const override;
    double exit_distance(Point3 from, Vector3 direction, double reach) const override;
    using Anatomy::at_rest;
    Vector3 breath_mm(double time_s) const override;
    Point3 at_rest(Point3 p, Vector3 breath_mm) const override;
    Point3 moved(Point3 rest, double time_s) const override;
    double greatest_shift_mm() const override { return std::abs(breathing_.amplitude_mm); }
    bool knows_tissue() const override { return true; }
    bool blocks_sound(int label) const override {
        return acoustics_[label].bone || acoustics_[label].gas;
    }
    Acoustics acoustics(int label) const override { return acoustics_[label]; }
    bool at_edge(Point3 p) const override;

  private:
    std::array<Acoustics, 256> acoustics_{};
    CaseView bundle_;
    BreathingMotion breathing_;
    BreathingField field_;  // empty: at rest
};

// A closed triangle mesh, as in trainers with mesh anatomy. Parity of crossings along +z, offset
// slightly so that no vertex or edge is hit; inside() tests the triangles of one grid column.
class MeshAnatomy final : public Anatomy {
  public:
    explicit MeshAnatomy(Surface mesh);
    bool inside(Point3 p) const override;
    double exit_distance(Point3 from, Vector3 direction, double reach) const override;

  private:
    const std::vector<std::uint32_t>& column(double x, double y) const;
    Surface mesh_;
    Box3 box_;
    int columns_x_ = 1, columns_y_ = 1;
    double column_mm_ = 1;
    std::vector<std::vector<std::uint32_t>> triangles_of_column_;
};

// Distance of the tip along the needle to the skin: > 0 inside, <= 0 outside (how far ahead the
// skin is, at most 10). skin: where the shaft passes it.
double insertion_depth_mm(const Anatomy& anatomy,
                          Point3 tip,
                          Vector3 direction,
                          double needle_length_mm,
                          Point3* skin = nullptr);

}  // namespace sonocase
