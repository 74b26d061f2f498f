// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/torso_model.h"

#include <algorithm>
#include <cctype>
#include <map>

#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline anatomy {
namespace {

struct Row {
    const char* name;  // then other names, by '|'; compared without '_'
    char side;         // 'b': on both sides, the row is the right one; ' ': in the middle or on one
    Vector3 at, spread;
    double half_mm;
    Vector3 length;
    double min_ml, usual_ml, max_ml, spread_ln;
};

// One for all: programs end them and their processes differently, and neighbours are alike.
constexpr Vector3 kVertebraSizeMm{52, 55, 34}, kRibSizeMm{75, 90, 80};

// Places (assumed): levels and sides as in any atlas of sectional anatomy, the figures read off CT
// maps and rounded. Usual volumes: masses of ICRP Publication 89 (2002), adult man, where it has
// the organ; spleen: Prassopoulos 1997 (215 ml, 107 to 315); pancreas: Saisho 2007 (72 +- 26 ml).
// Lengths: of a box of the structure's usual sides, less a quarter where it is round (assumed).
// Lower limits: a newborn of the same publication, halved; upper ones: organs of the largest
// cysts, effusions and pregnancies (assumed).
constexpr Row kRows[] = {
    {"liver", ' ', {62, 48, 95}, {22, 20, 28}, 85, {155, 135, 115}, 60, 1500, 8000, 0.3},
    {"spleen", ' ', {-100, -5, 98}, {18, 25, 28}, 55, {60, 70, 80}, 4, 180, 3500, 0.5},
    {"kidney|ren", 'b', {69, -2, 40}, {15, 17, 24}, 55, {48, 50, 82}, 6, 160, 3000, 0.4},
    {"adrenal_gland|adrenal|suprarenal_gland",
     'b',
     {38, 18, 85},
     {14, 15, 22},
     20,
     {19, 25, 30},
     0.5,
     4.5,
     150,
     0.5},
    {"gallbladder|gall_bladder|vesica_biliaris",
     ' ',
     {60, 72, 50},
     {24, 25, 28},
     35,
     {26, 38, 40},
     0.5,
     30,
     500,
     0.8},
    {"stomach|gaster", ' ', {-48, 70, 85}, {28, 27, 32}, 70, {80, 85, 90}, 5, 250, 4000, 0.8},
    {"pancreas", ' ', {-12, 55, 62}, {22, 18, 22}, 60, {110, 40, 50}, 2, 73, 700, 0.6},
    {"duodenum", ' ', {28, 48, 28}, {20, 20, 25}, 50, {70, 40, 70}, 3, 70, 800, 0.6},
    {"small_bowel|small_intestine|jejunum|ileum",
     ' ',
     {-8, 62, -50},
     {25, 24, 35},
     110,
     {170, 85, 170},
     30,
     700,
     6000,
     0.7},
    {"colon|large_bowel|large_intestine",
     ' ',
     {0, 58, -35},
     {28, 28, 40},
     160,
     {230, 105, 290},
     20,
     800,
     9000,
     0.7},
    {"urinary_bladder|bladder",
     ' ',
     {0, 40, -165},
     {12, 25, 32},
     50,
     {70, 65, 58},
     3,
     200,
     3000,
     0.9},
    {"prostate", ' ', {0, 5, -208}, {9, 20, 25}, 22, {36, 28, 30}, 0.7, 25, 500, 0.7},
    {"uterus", ' ', {0, 25, -140}, {18, 27, 35}, 45, {48, 52, 52}, 2, 80, 9000, 0.9},
    {"ovary", 'b', {42, 20, -125}, {20, 25, 30}, 20, {19, 22, 22}, 0.3, 7, 1000, 0.9},
    {"rectum", ' ', {0, -25, -160}, {15, 20, 28}, 60, {38, 45, 95}, 5, 90, 1200, 0.8},
    {"esophagus|oesophagus", ' ', {-5, 20, 190}, {12, 20, 55}, 120, {20, 35, 230}, 1, 35, 200, 0.6},
    {"trachea", ' ', {3, 20, 310}, {10, 20, 40}, 60, {30, 28, 100}, 1, 35, 120, 0.5},
    {"lung", 'b', {82, 15, 230}, {18, 27, 35}, 130, {80, 125, 175}, 20, 1900, 6000, 0.6},
    {"lung_upper_lobe", 'b', {75, 35, 275}, {20, 27, 35}, 100, {75, 110, 140}, 10, 950, 3500, 0.6},
    {"lung_lower_lobe", 'b', {78, -10, 205}, {18, 27, 35}, 100, {75, 95, 140}, 10, 900, 3500, 0.6},
    {"lung_middle_lobe_right",
     ' ',
     {85, 65, 215},
     {20, 27, 35},
     70,
     {65, 70, 75},
     4,
     400,
     1800,
     0.6},
    {"heart|heart_myocardium",
     ' ',
     {-18, 65, 215},
     {18, 22, 30},
     60,
     {90, 78, 85},
     15,
     650,
     2500,
     0.6},
    {"thymus", ' ', {0, 85, 265}, {12, 20, 30}, 40, {35, 20, 50}, 1, 25, 300, 0.8},
    {"thyroid_gland|thyroid", ' ', {0, 40, 350}, {10, 22, 25}, 30, {48, 20, 38}, 0.5, 18, 400, 0.6},
    {"superior_vena_cava", ' ', {24, 45, 265}, {12, 18, 25}, 40, {18, 18, 65}, 0.5, 18, 100, 0.6},
    {"aorta", ' ', {-13, 30, 90}, {12, 18, 60}, 150, {28, 45, 330}, 3, 130, 1000, 0.8},
    {"inferior_vena_cava|postcava|ivc",
     ' ',
     {19, 38, 60},
     {11, 17, 40},
     110,
     {22, 30, 220},
     1,
     75,
     400,
     0.6},
    {"portal_vein_and_splenic_vein|portal_vein|portal_and_splenic_vein",
     ' ',
     {5, 55, 70},
     {25, 20, 25},
     70,
     {110, 45, 45},
     0.5,
     28,
     300,
     0.7},
    {"iliac_artery", 'b', {42, 38, -118}, {15, 20, 30}, 80, {60, 60, 150}, 0.4, 18, 200, 0.7},
    {"iliac_vena|iliac_vein",
     'b',
     {42, 28, -120},
     {15, 20, 30},
     80,
     {60, 60, 150},
     0.4,
     28,
     250,
     0.7},
    {"hip|hip_bone|pelvis",
     'b',
     {77, 0, -138},
     {14, 20, 25},
     105,
     {90, 105, 160},
     10,
     370,
     1000,
     0.4},
    {"femur", 'b', {102, 5, -260}, {18, 25, 80}, 200, {65, 50, 420}, 5, 450, 1200, 0.9},
    {"sacrum", ' ', {0, -45, -110}, {9, 20, 22}, 60, {95, 65, 80}, 5, 190, 500, 0.4},
    {"spinal_cord|spinal_canal",
     ' ',
     {0, -25, 80},
     {9, 20, 90},
     200,
     {14, 40, 430},
     3,
     60,
     250,
     0.7},
    {"autochthon", 'b', {37, -58, 20}, {13, 20, 70}, 200, {55, 47, 420}, 20, 430, 1500, 0.6},
    {"iliopsoas|psoas", 'b', {60, 20, -85}, {20, 20, 35}, 140, {70, 70, 220}, 10, 250, 900, 0.6},
    {"gluteus_maximus", 'b', {92, -53, -165}, {18, 22, 30}, 90, {100, 60, 135}, 20, 700, 2000, 0.6},
    {"gluteus_medius", 'b', {122, -6, -122}, {18, 20, 28}, 70, {60, 75, 115}, 10, 280, 900, 0.5},
    {"gluteus_minimus", 'b', {116, 17, -142}, {18, 20, 28}, 50, {34, 65, 75}, 2, 72, 300, 0.5},
    {"costal_cartilages", ' ', {0, 110, 110}, {16, 28, 40}, 140, {280, 80, 140}, 3, 90, 400, 0.7},
    {"sternum", ' ', {0, 105, 210}, {10, 28, 35}, 80, {40, 40, 165}, 2, 90, 300, 0.6},
    {"clavicula|clavicle", 'b', {80, 60, 320}, {20, 25, 25}, 70, {125, 30, 28}, 1, 30, 100, 0.5},
    {"scapula", 'b', {125, -40, 270}, {20, 25, 30}, 75, {65, 65, 115}, 4, 110, 350, 0.5},
    {"humerus", 'b', {185, 0, 220}, {35, 45, 70}, 160, {45, 45, 320}, 4, 250, 700, 0.8},
    {"brain", ' ', {0, 50, 530}, {18, 40, 60}, 85, {100, 130, 100}, 200, 1400, 2000, 0.2},
    {"vertebrae_S1", ' ', {0, -24, -93}, {9, 18, 22}, 30, kVertebraSizeMm, 1, 50, 200, 0.5},
    {"rib_1", 'b', {42, 15, 300}, {18, 28, 25}, 40, kRibSizeMm, 0.3, 8, 50, 0.6},
    {"rib_2", 'b', {68, 25, 278}, {18, 28, 25}, 60, kRibSizeMm, 0.3, 12, 60, 0.6},
    {"rib_3", 'b', {90, 30, 255}, {18, 28, 25}, 75, kRibSizeMm, 0.3, 14, 60, 0.6},
    {"rib_4", 'b', {104, 32, 232}, {18, 28, 25}, 85, kRibSizeMm, 0.3, 16, 60, 0.6},
    {"rib_5", 'b', {115, 34, 210}, {18, 28, 25}, 90, kRibSizeMm, 0.3, 17, 60, 0.6},
    {"rib_6", 'b', {124, 35, 188}, {18, 28, 25}, 95, kRibSizeMm, 0.3, 17, 60, 0.6},
    {"rib_7", 'b', {130, 34, 166}, {18, 30, 25}, 95, kRibSizeMm, 0.3, 17, 60, 0.7},
    {"rib_8", 'b', {134, 28, 145}, {18, 32, 25}, 90, kRibSizeMm, 0.3, 15, 60, 0.7},
    {"rib_9", 'b', {136, 15, 122}, {18, 32, 25}, 85, kRibSizeMm, 0.3, 13, 60, 0.7},
    {"rib_10", 'b', {128, -8, 100}, {18, 30, 25}, 80, kRibSizeMm, 0.3, 10, 50, 0.7},
    {"rib_11", 'b', {103, -45, 82}, {18, 25, 22}, 60, kRibSizeMm, 0.2, 7, 40, 0.7},
    {"rib_12", 'b', {60, -53, 82}, {16, 22, 20}, 40, kRibSizeMm, 0.1, 3.5, 30, 0.7},
};

// L5 up to C1: middle of the whole vertebra, lordosis and kyphosis as a person lies.
struct Level {
    const char* name;
    double y, z, ml;
};
constexpr Level kVertebrae[] = {
    {"L5", -6, -69, 66},  {"L4", 1, -36, 66},   {"L3", 0, 0, 66},      {"L2", -8, 34, 61},
    {"L1", -18, 68, 58},  {"T12", -28, 99, 50}, {"T11", -35, 127, 44}, {"T10", -40, 153, 39},
    {"T9", -44, 178, 35}, {"T8", -47, 202, 32}, {"T7", -49, 225, 30},  {"T6", -49, 247, 27},
    {"T5", -48, 268, 25}, {"T4", -45, 288, 23}, {"T3", -40, 307, 22},  {"T2", -32, 326, 22},
    {"T1", -22, 344, 22}, {"C7", -12, 361, 18}, {"C6", -5, 376, 14},   {"C5", 0, 391, 13},
    {"C4", 3, 406, 12},   {"C3", 4, 421, 12},   {"C2", 4, 440, 14},    {"C1", 6, 456, 13},
};

// Lower case words: at anything that is no letter or digit, and before a capital after a small one.
std::vector<std::string> words_of(std::string_view name) {
    std::vector<std::string> words(1);
    char before = 0;
    for (const char c : name) {
        const auto u = static_cast<unsigned char>(c);
        const bool starts = std::isupper(u) && std::islower(static_cast<unsigned char>(before));
        if ((!std::isalnum(u) || starts) && !words.back().empty()) words.emplace_back();
        if (std::isalnum(u)) words.back() += static_cast<char>(std::tolower(u));
        before = c;
    }
    if (words.back().empty()) words.pop_back();
    return words;
}

std::string joined(const std::vector<std::string>& words) {
    std::string text;
    for (const std::string& word : words) text += word;
    return text;
}

struct Model {
    std::vector<ModelStructure> structures;
    std::map<std::string, int, std::less<>> by_name;  // words without gaps; sides at the end
};

void add(const ModelStructure& structure, const std::string& names, Model& model) {
    const auto index = static_cast<int>(model.structures.size());
    model.structures.push_back(structure);
    for (std::size_t at = 0; at <= names.size();) {
        const std::size_t end = std::min(names.find('|', at), names.size());
        std::string key = joined(words_of(names.substr(at, end - at)));
        if (structure.side != 0) key += structure.side > 0 ? ":r" : ":l";
        model.by_name[key] = index;
        at = end + 1;
    }
}

Model make_model() {
    Model model;
    for (const Row& row : kRows) {
        const std::string names = row.name, first = names.substr(0, names.find('|'));
        const std::string family = first.starts_with("rib_") ? "rib" : first;
        ModelStructure s{first,        family,     0,          row.at,       row.spread,
                         row.half_mm,  row.length, row.min_ml, row.usual_ml, row.max_ml,
                         row.spread_ln};
        if (first == "vertebrae_S1") s.family = "vertebrae";
        if (family == "rib") s.shape_ln = 0.6;
        if (row.side == ' ') {
            add(s, names, model);
            continue;
        }
        // TotalSegmentator puts the side before the number of a rib.
        const auto sided = [&](const char* side) {
            return s.family == "rib" ? std::string("rib_") + side + first.substr(3)
                                     : first + "_" + side;
        };
        const auto index = static_cast<int>(model.structures.size());
        s.name = sided("right");
        s.side = 1;
        s.other = index + 1;
        add(s, names, model);
        s.name = sided("left");
        s.side = -1;
        s.at.x = -s.at.x;
        s.other = index;
        add(s, names, model);
    }
    for (const Level& level : kVertebrae) {
        const std::string name = level.name;
        add({"vertebrae_" + name,
             "vertebrae",
             0,
             {0, level.y, level.z},
             {9, 18, 9},
             26,
             kVertebraSizeMm,
             level.ml / 30,
             level.ml,
             3 * level.ml,
             0.4},
            "vertebrae_" + name + "|vertebra_" + name + "|" + name, model);
    }
    return model;
}

const Model& model() {
    static const Model instance = make_model();
    return instance;
}

}  // namespace

std::span<const ModelStructure> torso_model() {
    return model().structures;
}

namespace {

// What a name means in a map by words without gaps; of a pair with ":r" or ":l" behind them.
template <class Map>
typename Map::const_iterator find_by_words(const Map& by_name, std::string_view name) {
    std::vector<std::string> words = words_of(name);
    const auto take_side = [&](std::initializer_list<const char*> sides) {
        const auto found = std::find_if(words.begin(), words.end(), [&](const std::string& word) {
            return std::find(sides.begin(), sides.end(), word) != sides.end();
        });
        if (found == words.end()) return false;
        words.erase(found);
        return true;
    };
    if (const auto whole = by_name.find(joined(words)); whole != by_name.end()) return whole;
    std::string side;
    if (take_side({"right", "r", "rt"}))
        side = ":r";
    else if (take_side({"left", "l", "lt"}))
        side = ":l";
    return by_name.find(joined(words) + side);
}

std::map<std::string, std::string, std::less<>> make_standard_names() {
    std::map<std::string, std::string, std::less<>> names;
    for (const std::string_view name : total_segmentator_labels()) {
        std::vector<std::string> words = words_of(name);
        std::string side;
        for (const auto& [word, end] : {std::pair{"right", ":r"}, {"left", ":l"}})
            if (std::erase(words, word) > 0) side = end;
        names[joined(words) + side] = std::string(name);
    }
    return names;
}

}  // namespace

int model_structure(std::string_view name) {
    const auto found = find_by_words(model().by_name, name);
    return found == model().by_name.end() ? -1 : found->second;
}

std::string standard_name(std::string_view name) {
    static const auto names = make_standard_names();
    const auto found = find_by_words(names, name);
    return found == names.end() ? "" : found->second;
}

bool is_body_name(std::string_view name) {
    const std::string text = joined(words_of(name));
    return text == "skin" || text == "body" || text == "bodytrunc" || text == "external" ||
           text == "outerbody";
}

}  // namespace sonocase::pipeline::inline anatomy
