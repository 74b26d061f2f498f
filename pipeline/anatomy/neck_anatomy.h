// SPDX-License-Identifier: Apache-2.0

// A neck by rule: skin, fat, muscles, spine, airway, thyroid, vessels and the tops of the lungs, as
// closed-form solids, and a carotid artery and internal jugular vein that vary from seed to seed as
// they do between people. No scan of anyone is in it.
//
// Frame `ct` (RAS+, mm): the origin lies in the neck's axis at the height of the cricoid cartilage;
// 180 mm wide, 140 deep, from the thyroid cartilage to the collar bones (z from -72 to 52). Every
// axial section is a list of ellipses; what runs across is a chain of capsules.
//
// What varies, and what the distributions follow (docs/procedures.md has the table): width, height
// and depth of the vein, diameter of the artery, and how much of the artery's width the vein
// covers as seen along the beam. Everything else is the textbook's arrangement (assumed).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline::inline anatomy {

inline constexpr double kNeckLowMm = -72, kNeckHighMm = 52;  // of the patient's grid

// Vein and artery of one side at the height of the cricoid cartilage, lying flat with the head a
// little down.
struct NeckVessels {
    double artery_mm = 0;       // diameter
    double vein_width_mm = 0;   // along the face of a probe over the vein
    double vein_height_mm = 0;  // along its beams
    double vein_depth_mm = 0;   // from the skin to the front wall
    double overlap = 0;         // share of the artery's width behind the vein, [0, 1]
    Point3 artery, vein;        // centres
    Vector3 outwards;           // from the vein to the probe, unit
    Vector3 sideways;           // away from the midline, unit, across `outwards`
};

class NeckAnatomy {
  public:
    // The same neck for the same seed, on every machine.
    explicit NeckAnatomy(std::uint64_t seed);

    static const std::vector<Label>& labels();  // outside first
    // right: the side of +x.
    const NeckVessels& vessels(bool right) const { return sides_[right ? 1 : 0].vessels; }

    // Palette index at a point. Cost: a microsecond; 30 ns where `section` is kept for a slice.
    std::uint8_t label(Point3 ct) const;

    struct Ellipse {  // of an axial section
        int label = 0;
        double x = 0, y = 0, a = 0, b = 0;  // centre and half-axes
        double cosine = 1, sine = 0;        // of the first axis
        double inner = 0;  // the part within this share of the half-axes is left out
    };
    struct Capsule {
        int label = 0;
        Point3 from, to;
        double radius = 0;
    };
    struct Section {
        double z = 0;
        std::vector<Ellipse> ellipses;  // where they overlap, the last one counts
        std::vector<Capsule> capsules;  // above the first ellipses_below ellipses
        std::size_t ellipses_below = 0;
    };
    Section section(double z) const;
    std::uint8_t label(const Section& section, double x, double y) const;

    // Point of the skin in direction theta (0 right, pi/2 front) at height z.
    Point3 skin_point(double theta, double z) const;

  private:
    struct Side {
        double sign = 1;
        double muscle_half_mm = 4;                      // half the thickness of the sternomastoid
        double along_outwards_mm = 0, sideways_mm = 0;  // from the artery to the vein
        Vector3 shift;                                  // of both vessels, for the vein's depth
        NeckVessels vessels;
    };
    void draw(Side& side, std::uint64_t seed);
    double skin(Point3 p, double depth_mm) const;  // negative deeper than depth_mm
    Point3 below_skin(double theta, double z, double depth_mm) const;
    Point3 artery_at(const Side& side, double z) const;
    Point3 vein_at(const Side& side, double z) const;
    double vein_scale(double z) const;
    void add_middle(Section& s) const;
    void add_muscles(const Side& side, Section& s) const;
    void add_bones(Section& s) const;
    void add_inlet(const Side& side, Section& s) const;
    void add_vessels(const Side& side, Section& s) const;

    double scale_ = 1, fat_mm_ = 3;
    std::array<Side, 2> sides_;
};

}  // namespace sonocase::pipeline::inline anatomy
