// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/headless/frame_files.h"

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/files/atomic_file.h"
#include "runtime/player/session/pictures/png_file.h"

namespace sonocase::runtime {

Result<std::unique_ptr<FrameFiles>> FrameFiles::in(const std::string& folder) {
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    if (failed) {
        return Error{"cannot make the folder: " + failed.message(), folder,
                     "check the path and its permissions"};
    }
    return std::unique_ptr<FrameFiles>(new FrameFiles(folder));
}

void FrameFiles::begin(int frames, int width_px, int height_px) {
    width_px_ = width_px;
    height_px_ = height_px;
    sheet_.reset();
    if (width_px > 1 && height_px > 1)
        sheet_ = std::make_unique<ContactSheet>(frames, width_px, height_px);
}

std::string FrameFiles::caption(double time_s, const Rigid& mannequin_from_probe) {
    const Vector3& p = mannequin_from_probe.translation;
    char text[96];
    std::snprintf(text, sizeof text, "%.1f S  %.0f %.0f %.0f MM", time_s, p.x, p.y, p.z);
    return text;
}

Status FrameFiles::add(int frame, std::span<const std::uint8_t> pixels, std::string_view caption) {
    char name[32];
    std::snprintf(name, sizeof name, "/frame_%05d.png", frame);
    const Status written = write_png(folder_ + name, width_px_, height_px_, 1, pixels, copyright_);
    if (written && sheet_) sheet_->add(frame, pixels, caption);
    return written;
}

Status FrameFiles::add_colour(int frame,
                              std::span<const std::uint8_t> grey,
                              std::span<const std::uint8_t> rgb,
                              std::string_view caption) {
    char name[32];
    std::snprintf(name, sizeof name, "/frame_%05d.png", frame);
    const auto rows = rgb.size() / 3 / static_cast<std::size_t>(width_px_);
    const Status written =
        write_png(folder_ + name, width_px_, static_cast<int>(rows), 3, rgb, copyright_);
    if (written && sheet_) sheet_->add(frame, grey, caption);
    return written;
}

Status FrameFiles::finish(const About& about) {
    const nlohmann::ordered_json json = {
        {"program", about.program},         {"case", about.case_name},
        {"exercise", about.exercise},       {"picture_height_px", height_px_},
        {"mm_per_px", about.mm_per_px},     {"origin_x_px", about.origin_x_px},
        {"origin_y_px", about.origin_y_px}, {"frames_per_s", about.frames_per_s}};
    const auto replace =
        nlohmann::ordered_json::error_handler_t::replace;  // names need not be UTF-8
    const Status written =
        write_file(folder_ + "/pictures.json", json.dump(1, ' ', false, replace) + "\n");
    if (!written) return written;
    return sheet_ ? sheet_->write(folder_ + "/contact-sheet.png", copyright_) : Status(Done{});
}

}  // namespace sonocase::runtime
