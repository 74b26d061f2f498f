// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/sequence.h"

#include <cctype>
#include <cmath>
#include <cstdio>

#include "formats/text/number_text.h"

namespace sonocase {
namespace {

std::string frame_prefix(std::size_t index) {
    char digits[24];
    std::snprintf(digits, sizeof digits, "%04zu", index);
    return std::string("Seq_Frame") + digits + "_";
}

// On one line, so that no reader can find another key in it.
std::string one_line(std::string_view value) {
    std::string out(value);
    for (char& c : out) {
        if (static_cast<unsigned char>(c) < 32) c = ' ';
    }
    return out;
}

std::string one_name(std::string_view name) {
    std::string out(name);
    for (char& c : out) {
        if (!std::isalnum(static_cast<unsigned char>(c)) && c != '_' && c != '-') c = '_';
    }
    return out;
}

void append_field(std::string& out,
                  std::string_view name,
                  std::string_view value,
                  SequenceForm form) {
    out += one_name(name);
    out += form == SequenceForm::mha ? " = " : ":=";
    out += one_line(value);
    out += '\n';
}

}  // namespace

std::size_t Sequence::frame_bytes() const {
    std::size_t each = 0;
    if (element == "MET_UCHAR" || element == "MET_CHAR") each = 1;
    if (element == "MET_USHORT" || element == "MET_SHORT") each = 2;
    if (element == "MET_UINT" || element == "MET_INT" || element == "MET_FLOAT") each = 4;
    if (element == "MET_DOUBLE") each = 8;
    return each * static_cast<std::size_t>(width) * static_cast<std::size_t>(height) *
           static_cast<std::size_t>(depth) * static_cast<std::size_t>(channels);
}

int Sequence::transform_index(std::string_view name) const {
    for (std::size_t i = 0; i < transforms.size(); ++i) {
        if (transforms[i] == name) return static_cast<int>(i);
    }
    return -1;
}

std::optional<Rigid> rigid_from_matrix(const std::array<double, 16>& m) {
    Rigid t;
    for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) t.rotation.m[3 * r + c] = m[4 * r + c];
        t.translation[static_cast<int>(r)] = m[4 * r + 3];
    }
    const bool last_row = m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1;
    if (!last_row || !is_finite(t)) return {};
    // 1e-3: errors of six printed decimals and of single-precision drivers stay well below, scales
    // do not.
    if (!(orthonormality_error(t.rotation) < 1e-3) || !(determinant(t.rotation) > 0)) return {};
    return t;
}

std::array<double, 16> matrix_from_rigid(const Rigid& t) {
    std::array<double, 16> m{};
    for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) m[4 * r + c] = t.rotation.m[3 * r + c];
        m[4 * r + 3] = t.translation[static_cast<int>(r)];
    }
    m[15] = 1;
    return m;
}

void append_sequence_frame_text(std::string& out,
                                const std::vector<std::string>& transforms,
                                std::size_t index,
                                const SequenceFrame& frame,
                                SequenceForm form) {
    const std::string prefix = frame_prefix(index);
    const auto field = [&](std::string_view name, std::string_view value) {
        append_field(out, prefix + std::string(name), value, form);
    };
    field("FrameNumber", std::to_string(frame.number));
    field("Timestamp", number_text(frame.timestamp_s));
    field("UnfilteredTimestamp", number_text(frame.unfiltered_timestamp_s));
    std::string numbers;
    for (std::size_t i = 0; i < transforms.size() && i < frame.poses.size(); ++i) {
        numbers.clear();
        for (const double v : frame.poses[i].to_from) {
            if (!numbers.empty()) numbers += ' ';
            append_number(numbers, v);
        }
        field(transforms[i] + "Transform", numbers);
        field(transforms[i] + "TransformStatus", frame.poses[i].ok ? "OK" : "INVALID");
    }
    for (const SequenceField& f : frame.fields) field(f.name, f.value);
    field(form == SequenceForm::mha ? "ImageStatus" : "Status", frame.image_ok ? "OK" : "INVALID");
}

}  // namespace sonocase
