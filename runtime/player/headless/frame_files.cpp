// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/headless/frame_files.h"

#include <cstdio>
#include <filesystem>

#include "runtime/player/session/png_file.h"

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

Status FrameFiles::add(int frame, std::span<const std::uint8_t> pixels) {
    char name[32];
    std::snprintf(name, sizeof name, "/frame_%05d.png", frame);
    const Status written = write_png(folder_ + name, width_px_, height_px_, 1, pixels);
    if (written && sheet_) sheet_->add(frame, pixels);
    return written;
}

Status FrameFiles::finish() {
    return sheet_ ? sheet_->write(folder_ + "/contact-sheet.png") : Status(Done{});
}

}  // namespace sonocase::runtime
