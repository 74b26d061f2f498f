// SPDX-License-Identifier: Apache-2.0

// Whether a label map is the human torso that its names say: what no header can tell.
//
// Each named structure has a usual place, spread, volume and lengths in an adult's torso
// (torso_model.cpp). A map's labels are compared with them under several hypotheses:
// the map is right; its axes are turned round or exchanged; its unit or one spacing is wrong; its
// names are shifted, exchanged or another table's; one name covers two organs. Each hypothesis may
// still shift, stretch and tilt the model as bodies differ, with normal priors: about 12 % in size,
// beside children, 9 % between axes, 12 degrees of tilt. Positions and logarithms of volumes and of
// lengths along the axes have Student's t distribution with eight degrees of freedom, such that no
// single organ decides. What a cut face of the grid may have taken from an organ widens its spread
// along that axis. The hypothesis of the greatest posterior density is reported if it beats "the
// map is right" by more than AnatomyOptions::margin.
//
// A finding is a likely cause and no proof, hence a warning; an error where no human body fits.
// docs/anatomy-check.md has the rates of faults that are found, and of false alarms.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline::inline anatomy {

// One label as the check sees it, in the patient's frame `ct`: RAS+, mm.
struct LabelSummary {
    std::string name;
    int value = 0;  // in the file
    double ml = 0;
    Point3 centre;  // mean of its voxels
    // Of rods that spread as far along the axes of the frame: those of a box are its sides. 0: not
    // known.
    Vector3 length_mm{0, 0, 0};
    Box3 box;                                   // of its voxel centres
    std::array<bool, 3> cut_low{}, cut_high{};  // it reaches the grid's face on that side
};

struct BodySummary {
    std::vector<LabelSummary> labels;  // those with voxels, in the palette's order, without outside
    Box3 field;                        // of the grid's voxel centres
    Vector3 voxel_mm{1, 1, 1};         // along the axes of the frame
};

// Cost: one pass over the voxels. ct_from_grid: turns the grid's own frame into `ct`.
BodySummary summarise_body(const LabelVolume& labels, const Matrix3& ct_from_grid = {});

inline constexpr int kAnatomyCheckVersion = 1;  // of what it warns of

enum class AnatomyCause : std::uint8_t {
    mirrored,        // left and right exchanged, of organs and of names with a side
    front_and_back,  // y turned round alone
    upside_down,     // z turned round alone
    turned_about_x,  // by 180 degrees: y and z turned round
    turned_about_y,  // x and z
    turned_about_z,  // x and y: LPS taken for RAS
    all_turned,      // x, y and z
    axes_exchanged,  // another of the 48 orientations
    situs_inversus,  // organs mirrored, names with a side right; or all names' sides exchanged as well
    sides_of_names,   // names with a side exchanged, organs right
    unit,             // a factor on all axes
    spacing,          // a factor on one axis
    names_shifted,    // each label has the name of its neighbour in the table
    names_exchanged,  // labels whose names fit each other, or other structures
    two_in_one,       // one name covers two structures
    volumes,          // organs of a volume that no body has
    out_of_place,     // one or two organs far from where the others say
};

struct AnatomyFinding {
    AnatomyCause cause{};
    bool error = false;  // no human body fits
    int axis = -1;       // of `spacing`
    double factor = 1;   // of `unit` and `spacing`: measured by expected
    int renamed = 0;     // labels that it gives other names: of `names_...`
    double margin = 0;   // natural logarithm of how much likelier it is than "the map is right"
    std::string text;    // a sentence with the likely cause and what to do
};

struct AnatomyReport {
    int known = 0;  // labels whose names the model knows
    bool checked = false;
    std::vector<AnatomyFinding> findings;
    // A body far smaller or larger than an adult's, which may be a child's, or a wrong voxel size;
    // a whole sentence, else empty.
    std::string size;
    std::vector<std::string> remarks;  // worth knowing, no warning: organs that are not there, cuts

    // "agrees: 24 of 25 known structures", "not checked: only 2 named organs", or the findings.
    std::string verdict() const;
};

struct AnatomyOptions {
    bool mesh = false;  // what to advise: --axes rather than --orientation
    double margin = 3;  // of a finding, > 0
};

AnatomyReport check_anatomy(const BodySummary& body, const AnatomyOptions& options = {});

// How well the names fit the labels, for choosing among the tables that could name a map: call it
// once for each.
//
// agreement  natural logarithm of the density of all places and volumes under the names, against
//            the same labels without names, per known label; empty with fewer than four labels
//            whose names are known. Right names have 6 to 8, a shifted table below 2
// misfits    "8 would be adrenal_gland_right of 91 ml": a volume or a length that no person has,
//            two structures that lie the other way round than in all but very few people
struct NamesFit {
    std::optional<double> agreement;
    std::vector<std::string> misfits;
    bool gross = false;  // a volume

    bool agrees() const;  // no misfit, and agreement above kNamesAgree
};
inline constexpr double kNamesAgree = 3;
NamesFit names_fit(const BodySummary& body);

// Whether the model knows a structure of this name, in English, by TotalSegmentator or others.
bool is_known_structure(std::string_view name);

// Checks labels and adds to a report: the note "anatomy", and a warning for each finding. Returns
// the error of the first finding that is one, unless accepted.
std::optional<std::string> report_anatomy(const LabelVolume& labels,
                                          const AnatomyOptions& options,
                                          StageReport& report);

}  // namespace sonocase::pipeline::inline anatomy
