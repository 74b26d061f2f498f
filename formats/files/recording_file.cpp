// SPDX-License-Identifier: Apache-2.0

#include "formats/files/recording_file.h"

#include <string_view>

#include "formats/files/whole_file.h"
#include "formats/recording/transform_log.h"

namespace sonocase {

Result<std::vector<Pose>> load_poses(const std::string& path) {
    const auto text = read_text_file(path);
    if (!text) return text.error();
    return parse_poses(*text, path);
}

Result<Sequence> load_sequence(const std::string& path) {
    return detail::read_whole(
        path, [&](const RawVector<std::uint8_t>& bytes) { return read_sequence(bytes, path); });
}

Status save_sequence(const Sequence& sequence, const std::string& path, bool compress) {
    const bool nrrd = path.size() >= 5 && path.compare(path.size() - 5, 5, ".nrrd") == 0;
    return write_file(
        path, write_sequence(sequence, nrrd ? SequenceForm::nrrd : SequenceForm::mha, compress));
}

Result<Sequence> load_recording_file(const std::string& path) {
    return detail::read_whole(path, [&](const RawVector<std::uint8_t>& bytes) {
        const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        if (looks_like_transform_log(text)) return parse_transform_log(text, path);
        return read_sequence(bytes, path);
    });
}

}  // namespace sonocase
