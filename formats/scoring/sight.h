// SPDX-License-Identifier: Apache-2.0

// The part of the scan plane that a probe shows, what sound reaches there, and how far a straight
// needle shows. Renderer's truth, live marks, scores, reviews, data sets and the planner of needle
// paths all ask here, and a test compares the answers with rendered pixels.
#pragma once

#include "formats/base/geometry.h"
#include "formats/exercise/exercise.h"
#include "formats/scoring/anatomy.h"

namespace sonocase {

// Scan plane: x lateral, z depth, mm, origin at the middle of the probe face (x and z of the
// `probe` frame).
//     linear       |x| <= width / 2, 0 <= z <= depth
//     curvilinear  polar about (0, -radius): radius <= r <= radius + depth, |angle| <= field of
//                  view / 2
//     phased       the same with radius 0
bool in_image(const Probe& probe, double x, double z);

// Distance from (x, z) to that region; 0 inside.
double distance_to_image(const Probe& probe, double x, double z);

// The part of a segment that lies in the image, as fractions of the way from its first point to its
// last; low >= high: none.
struct ImageInterval {
    double low = 0, high = 0;
    double share() const { return high > low ? high - low : 0; }
};

// Part of the segment a-b (`probe` frame) that lies in the image: within half_slab_mm of the scan
// plane and inside the region; the hollow between a curved face and its chord counts as inside.
// Exact: clipping by planes and a circle leaves one interval of the segment.
ImageInterval interval_in_image(const Probe& probe, Point3 a, Point3 b, double half_slab_mm);
// The length of that part.
double length_in_image(const Probe& probe, Point3 a, Point3 b, double half_slab_mm);

inline constexpr double kSightStepMm = 1;   // spacing of the tested points of a scan line
inline constexpr double kSightShaftMm = 2;  // spacing of the tested points of a shaft
// The rule by which a needle counts as visible, stated beside scores: 1 counted everything in a
// bone's shadow and under more than 4 mm of air as unseen, and measured the needle outside the
// sector as well; 2 is the one below.
inline constexpr int kSightRule = 2;

// True if the scan line through the point meets the body within the gap that the picture closes,
// and neither bone nor gas before the point. Tissue counts where breathing has moved it. A point
// off the scan plane has the scan line of its projection on the plane, shifted by its distance to
// the plane. Always true where the anatomy does not know its tissues.
//
// mannequin_from_probe  pose of the probe
// p_probe               the point, `probe` frame
// Cost: one look-up per millimetre of depth, no allocation.
bool sound_reaches(const Anatomy& anatomy,
                   const Probe& probe,
                   const Rigid& mannequin_from_probe,
                   Point3 p_probe,
                   double time_s);

// What a frame shows of a needle at neutral settings (gain 0). A point of it is visible if it lies
// in the image, at most half the slab that the needle shows in from the scan plane, and its own
// echo stands out of what is around it by kShownGrey. Both echoes are dimmed by the tissue before
// them, as in model `physical`: a needle in the shadow of thin bone may show, and one behind the
// edge of the face that has no contact does not. The needle's echo follows the angle between beam
// and shaft, its tip also the side that the bevel faces, as its make has them. Where the anatomy is
// null or knows no tissues, whatever lies in the image is visible.
class NeedleSight {
  public:
    static constexpr double kShownGrey = 7.5;  // of 255, where liver has 80

    // The anatomy must outlive the sight.
    NeedleSight(const Anatomy* anatomy, const Exercise& exercise);

    // Grey levels by which a point of the needle stands out. axis_probe: unit, hub to tip;
    // bevel_probe: unit, the side that the bevel faces; from_tip_mm: back along the shaft. 0 where
    // no sound comes. Whether the point lies in the image does not matter. Cost: that of
    // sound_reaches().
    double contrast(const Rigid& mannequin_from_probe,
                    Point3 p_probe,
                    Vector3 axis_probe,
                    Vector3 bevel_probe,
                    double from_tip_mm,
                    double time_s) const;
    bool tip_visible(const Rigid& mannequin_from_probe,
                     Point3 tip_probe,
                     Vector3 axis_probe,
                     Vector3 bevel_probe,
                     double time_s) const;
    // Length of the shaft from tip to skin (`probe` frame) that is visible; tried every
    // kSightShaftMm.
    double visible_mm(const Rigid& mannequin_from_probe,
                      Point3 tip_probe,
                      Point3 skin_probe,
                      double time_s) const;
    // Length of the shaft that lies before or behind the image or in it: its projection on the
    // scan plane is inside the sector, however far from the plane it is.
    double in_sector_mm(Point3 tip_probe, Point3 skin_probe) const;
    // The tip has not reached the sector, and its straight way ahead, at most the needle's length,
    // enters the image within the slab.
    bool on_the_way(Point3 tip_probe, Vector3 axis_probe) const;
    double half_slab_mm() const { return half_slab_mm_; }

  private:
    const Anatomy* anatomy_;
    Probe probe_;
    const NeedleMake* make_;
    double length_mm_ = 0, half_slab_mm_ = 0, echo_ = 0;
};

}  // namespace sonocase
