// SPDX-License-Identifier: Apache-2.0

#include "formats/base/clinical_names.h"

#include <algorithm>
#include <cctype>

namespace sonocase {
namespace {

// Labels of TotalSegmentator, of the analytic torso and of kinds of pathology whose own words are
// not those of a clinician. What is muscle by its density alone may be vessel wall or diaphragm.
constexpr ClinicalName kNames[] = {
    {"autochthon", "Erector spinae muscle"},
    {"clavicula", "Clavicle"},
    {"costal_cartilages", "Costal cartilage"},
    {"esophagus", "Oesophagus"},
    {"gas_in_body", "Gas"},
    {"gut", "Bowel"},
    {"hcc", "Hepatocellular carcinoma"},
    {"hip", "Hip bone"},
    {"iliac_vena", "Iliac vein"},
    {"iliopsoas", "Iliopsoas muscle"},
    {"intervertebral_discs", "Intervertebral disc"},
    {"kidney_cyst", "Renal cyst"},
    {"kidney_sinus", "Renal sinus"},
    {"kidney_stone", "Renal stone"},
    {"lung_lower_lobe", "Lower lobe of the lung"},
    {"lung_middle_lobe", "Middle lobe of the lung"},
    {"lung_upper_lobe", "Upper lobe of the lung"},
    {"other_dense_bone_or_metal", "Bone"},
    {"other_fat", "Fat"},
    {"other_muscle_like", "Muscle and soft tissue"},
    {"other_soft_tissue", "Soft tissue"},
    {"outside_body", "Outside the body"},
    {"phantom_stenosis", "Stenosis"},
    {"phantom_tissue", "Tissue"},
    {"phantom_tube", "Tube"},
    {"portal_vein_and_splenic_vein", "Portal or splenic vein"},
    {"vertebrae", "Vertebra"},
    {"visceral_fat", "Intra-abdominal fat"},
};

bool whole_number(std::string_view text) {
    return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) {
        return std::isdigit(static_cast<unsigned char>(c)) != 0;
    });
}

// "3mm", "1p5mm": a size that a model's label carries.
bool is_size(std::string_view text) {
    return text.size() > 2 && text.substr(text.size() - 2) == "mm" &&
           std::isdigit(static_cast<unsigned char>(text[0]));
}

// A vertebra: C1 to S5.
bool is_level(std::string_view text) {
    return text.size() >= 2 && std::string_view("CTLS").find(text[0]) != std::string_view::npos &&
           whole_number(text.substr(1));
}

// Cuts "_c" off "a_b_c"; empty: there is one part alone.
std::string_view last_part(std::string_view name) {
    const std::size_t at = name.rfind('_');
    return at == std::string_view::npos || at == 0 ? std::string_view{} : name.substr(at + 1);
}
void drop(std::string_view& name, std::string_view part) {
    name.remove_suffix(part.size() + 1);
}

std::string readable(std::string_view label) {
    std::string words(label);
    std::replace(words.begin(), words.end(), '_', ' ');
    if (!words.empty())
        words[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(words[0])));
    return words;
}

std::string ordinal(const std::string& number) {
    const int n = number.size() < 6 ? std::stoi(number) : 0;
    const char* end = n % 100 >= 11 && n % 100 <= 13 ? "th"
                      : n % 10 == 1                  ? "st"
                      : n % 10 == 2                  ? "nd"
                      : n % 10 == 3                  ? "rd"
                                                     : "th";
    return number + end;
}

}  // namespace

std::span<const ClinicalName> clinical_names() {
    return kNames;
}

LabelParts label_parts(std::string_view label) {
    LabelParts parts;
    if (const std::string_view size = last_part(label); is_size(size)) drop(label, size);
    std::string_view last = last_part(label);
    if (whole_number(last) || is_level(last)) {
        parts.number = last;
        drop(label, last);
        last = last_part(label);
    }
    if (last == "left" || last == "right") {
        parts.side = last;
        drop(label, last);
    }
    const auto found = std::find_if(std::begin(kNames), std::end(kNames),
                                    [&](const ClinicalName& name) { return name.label == label; });
    parts.words = found != std::end(kNames) ? std::string(found->words) : readable(label);
    return parts;
}

std::string clinical_name(std::string_view label) {
    LabelParts parts = label_parts(label);
    const auto lower = [](std::string words) {
        // Not of an abbreviation.
        if (words.size() > 1 && !std::isupper(static_cast<unsigned char>(words[1])))
            words[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(words[0])));
        return words;
    };
    std::string out = parts.words;
    if (parts.words == "Rib" && whole_number(parts.number)) {
        out = ordinal(parts.number) + " rib";
    } else if (is_level(parts.number)) {
        out = parts.number + " " + lower(parts.words);
    } else if (!parts.number.empty()) {
        out += " " + parts.number;
    }
    if (parts.side.empty()) return out;
    return readable(parts.side) + " " + lower(out);
}

}  // namespace sonocase
