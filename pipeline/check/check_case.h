// SPDX-License-Identifier: Apache-2.0

// Checks a case as a careful colleague would: organs and their volumes, sides, vessels, units,
// the fit, exercises and whether a needle reaches their targets.
//
// A fault has a name that a program can go by and a sentence that says what to do:
//
//     organ-missing    an organ that the others around it call for is not there, or is empty
//     sides-swapped    right and left, judged by liver and spleen and by pairs of labels
//     wrong-unit       a body or organs of a size that no adult has
//     vessel-broken    the aorta or the lower cava is in pieces
//     fold             the fit's report does not prove that the map is free of folds
//     label-renamed    an exercise names a label that is missing, or a label's name says another
//                      tissue than it has
//     texture-missing  a tissue names a solid texture that the bundle lacks
//     target-in-bone   a target that no needle can enter
//     target-elsewhere a target that lies in another label than its `inside`
//     unreachable      no window on the skin sees the target, or none lets a needle pass
//     not-passable     a scripted expert plays the exercise through the first windows and misses a
//                      pass mark, or a mark is of targets and there is none
//     sweep-in-air     a scripted sweep whose probe or needle is not where the body is
//     not-valid        what `validate` refuses
#pragma once

#include <map>
#include <string>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "pipeline/export/error_budget.h"

namespace sonocase::pipeline::inline check {

struct Fault {
    std::string name;
    std::string what;    // a sentence
    std::string remedy;  // what to do
};

struct OrganRow {
    std::string label;
    double ml = 0;
    double low_ml = 0, high_ml = 0;  // normal range of an adult; both 0: none known
};

struct TargetRow {
    std::string exercise, target, inside;
    double depth_mm = 0, blocked = 0;  // of the best window
    int windows = 0;
    bool needle = false;
    double visible = 0;  // share of the needle's path that the image shows
};

struct ExerciseRow {
    std::string exercise;
    bool played = false;              // false: a target has no window, or there is none
    std::vector<std::string> missed;  // pass marks that the expert missed
};

struct CheckResult {
    std::vector<Fault> faults;
    std::vector<std::string> remarks;  // worth a look, no fault
    std::vector<OrganRow> organs;
    std::vector<TargetRow> targets;
    std::vector<ExerciseRow> exercises;
    int ribs_right = 0, ribs_left = 0;
    Vector3 forwards, up;  // of the patient in the grid, judged by organs; zero: not known
};

// Cost: 1 to 10 s.
CheckResult check_case(const CaseBundle& bundle);

// One page that opens in any browser, pictures inside. points: what seconds buy in this case, of
// case_points() (pipeline/tradeoff/choose_settings.h); empty: the page does not say.
std::string check_page(const CaseBundle& bundle,
                       const CheckResult& result,
                       const std::vector<CasePoint>& points = {});

// One picture of the whole case as PNG: planes through the middle along the patient's axes with R
// and L, views of organs and bones, and for each exercise the plane in which its first sweep
// begins, with probe, needle and target, and beside it the ultrasound there. ultrasound: PNG of
// kSheetPx by kSheetPx, by the exercises' names; of some or none. Cost: 0.5 s.
inline constexpr int kSheetPx = 380;
std::vector<std::uint8_t> case_sheet(
    const CaseBundle& bundle,
    const CheckResult& result,
    const std::map<std::string, std::vector<std::uint8_t>>& ultrasound = {});

// {"case", "faults": [{"name", "what", "remedy"}], "remarks", "organs", "targets", "exercises",
// "ribs": {"right", "left"}}.
std::string check_json(const CaseBundle& bundle, const CheckResult& result);

// Parts of check_case, in their own files.
void check_anatomy(const CaseBundle& bundle, CheckResult& result);
void check_exercises(const CaseBundle& bundle, CheckResult& result);

// A view of organs and bones in their colours, shaded, along a direction; skin, fat and muscle are
// left out, targets are white dots. RGB, rows from the top.
struct BodyView {
    int width_px = 0, height_px = 0;
    std::vector<std::uint8_t> rgb;
};
BodyView body_view(const CaseBundle& bundle,
                   Vector3 along,
                   Vector3 up,
                   const std::vector<Point3>& marks,
                   int height_px = 600);

}  // namespace sonocase::pipeline::inline check
