// SPDX-License-Identifier: Apache-2.0

#include "formats/files/growing_sequence.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

namespace sonocase {
namespace {

constexpr std::string_view kEndLine = "ElementDataFile = LOCAL\n";
constexpr std::string_view kSpentLine = "CommentRecorder = batch\n";
static_assert(kEndLine.size() == kSpentLine.size());
constexpr std::uint64_t kAlignment = 64;  // a line that starts at a multiple stays in one sector

std::string digits_of(std::size_t frames) {
    char text[16];
    std::snprintf(text, sizeof text, "%010zu", frames);
    return text;
}

// Appends a comment that brings the text's end to a multiple of kAlignment in the file.
void append_padding(std::string& text, std::uint64_t starts_at) {
    static constexpr std::string_view kComment = "Comment = ";
    const std::uint64_t end = starts_at + text.size() + kComment.size() + 1;
    text += kComment;
    text.append(static_cast<std::size_t>((kAlignment - end % kAlignment) % kAlignment), '-');
    text += '\n';
}

}  // namespace

Error GrowingSequence::fault(const char* doing, int number) const {
    return {Message(doing, {std::strerror(number)}), path_,
            "earlier frames are kept; make room on the disk"};
}

Result<GrowingSequence> GrowingSequence::create(const std::string& path, const Sequence& head) {
    GrowingSequence out;
    out.path_ = path;
    out.transforms_ = head.transforms;
    Sequence empty = head;
    empty.frames.clear();
    std::string text = sequence_head_text(empty, "1 1 " + digits_of(0));
    const std::string key = "DimSize = 1 1 ";
    out.size_digits_at_ = text.find(key) + key.size();
    append_padding(text, 0);
    out.end_line_at_ = text.size();
    text += kEndLine;
    // Under another name first, so that a full disk does not destroy the previous session.
    const std::string temporary = path + ".part-" + std::to_string(::getpid());
    out.fd_ = ::open(temporary.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (out.fd_ < 0) {
        return Error{Message("cannot record: {}", {std::strerror(errno)}), path,
                     "check that the folder exists and is writable"};
    }
    if (!out.write_at(0, text) || ::fdatasync(out.fd_) != 0 ||
        ::rename(temporary.c_str(), path.c_str()) != 0) {
        const int number = errno;
        ::unlink(temporary.c_str());
        return Error{Message("cannot record: {}", {std::strerror(number)}), path,
                     "nothing was written"};
    }
    return out;
}

GrowingSequence::GrowingSequence(GrowingSequence&& other) noexcept {
    *this = std::move(other);
}

GrowingSequence& GrowingSequence::operator=(GrowingSequence&& other) noexcept {
    std::swap(path_, other.path_);
    std::swap(fd_, other.fd_);
    std::swap(transforms_, other.transforms_);
    std::swap(frames_, other.frames_);
    std::swap(size_digits_at_, other.size_digits_at_);
    std::swap(end_line_at_, other.end_line_at_);
    return *this;
}

GrowingSequence::~GrowingSequence() {
    if (fd_ >= 0) ::close(fd_);
}

bool GrowingSequence::write_at(std::uint64_t offset, const std::string& text) {
    std::size_t done = 0;
    while (done < text.size()) {
        const ssize_t n = ::pwrite(fd_, text.data() + done, text.size() - done,
                                   static_cast<off_t>(offset + done));
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return false;
        done += static_cast<std::size_t>(n);
    }
    return true;
}

Status GrowingSequence::append(std::span<const SequenceFrame> frames) {
    if (frames.empty()) return Done{};
    const std::uint64_t from = end_line_at_ + kEndLine.size();
    std::string text;
    for (std::size_t i = 0; i < frames.size(); ++i) {
        append_sequence_frame_text(text, transforms_, frames_ + i, frames[i]);
    }
    append_padding(text, from);
    const std::uint64_t end_line_at = from + text.size();
    text += kEndLine;
    const std::size_t count = frames_ + frames.size();
    // The pixels: the hole behind the text reads as zeros and takes no disk space.
    if (::ftruncate(fd_, static_cast<off_t>(from + text.size() + count)) != 0)
        return fault("cannot record: {}", errno);
    if (!write_at(from, text)) return fault("cannot record: {}", errno);
    if (::fdatasync(fd_) != 0) return fault("cannot record: {}", errno);
    if (!write_at(end_line_at_, std::string(kSpentLine))) return fault("cannot record: {}", errno);
    end_line_at_ = end_line_at;
    if (::fdatasync(fd_) != 0) return fault("cannot record: {}", errno);
    if (!write_at(size_digits_at_, digits_of(count))) return fault("cannot record: {}", errno);
    frames_ = count;
    return Done{};
}

}  // namespace sonocase
