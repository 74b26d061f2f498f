#include "pipeline/files.h"

#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;

struct CloseFile {
    void operator()(std::FILE* file) const { std::fclose(file); }
};
using FilePointer = std::unique_ptr<std::FILE, CloseFile>;

Error system_error(const std::string& doing, const std::string& path, const std::string& todo) {
    return {doing + ": " + std::strerror(errno), path, todo};
}

// Unlike any other name in use: by this process (counter), on this machine (process number), and,
// with a folder shared by machines, anywhere (host name).
std::string temporary_name(const std::string& path) {
    static std::atomic<unsigned> counter{0};
    char host[64] = "host";
    gethostname(host, sizeof host - 1);
    const fs::path whole(path);
    std::string name = whole.filename().string();
    const std::string ending =
        name.size() > 7 && name.ends_with(".nii.gz") ? ".nii.gz" : whole.extension().string();
    name = "." + name + "." + host + "." + std::to_string(getpid()) + "." +
           std::to_string(counter++) + ".tmp" + ending;
    return (whole.parent_path() / name).string();
}

}  // namespace

Result<std::vector<std::uint8_t>> read_file(const std::string& path) {
    std::error_code code;
    if (!fs::exists(path, code)) return Error{"no such file", path, "check the path"};
    if (fs::is_directory(path, code)) return Error{"is a folder", path, "expected a file"};
    FilePointer file(std::fopen(path.c_str(), "rb"));
    if (!file) return system_error("cannot open", path, "check that it may be read");
    std::vector<std::uint8_t> bytes;
    std::uint8_t buffer[1 << 16];
    for (;;) {
        const std::size_t n = std::fread(buffer, 1, sizeof buffer, file.get());
        bytes.insert(bytes.end(), buffer, buffer + n);
        if (n < sizeof buffer) break;
    }
    if (std::ferror(file.get())) return system_error("cannot read", path, "check the disk");
    return bytes;
}

Result<std::string> read_text_file(const std::string& path) {
    auto bytes = read_file(path);
    if (!bytes) return bytes.error();
    return std::string(bytes->begin(), bytes->end());
}

Status write_file(const std::string& path, std::span<const std::uint8_t> bytes) {
    std::error_code code;
    const bool special =
        fs::exists(path, code) && !fs::is_regular_file(path, code) && !fs::is_directory(path, code);
    if (special || path.starts_with("/dev/") || path.starts_with("/proc/")) {
        // A pipe or a device, or /dev/stdout, which may lead to a file: renaming would replace it.
        FilePointer file(std::fopen(path.c_str(), "ab"));
        if (!file || std::fwrite(bytes.data(), 1, bytes.size(), file.get()) != bytes.size() ||
            std::fflush(file.get()) != 0)
            return system_error("cannot write", path, "check that it may be written");
        return Done{};
    }
    OutputFile output(path);
    {
        FilePointer file(std::fopen(output.temporary().c_str(), "wb"));
        if (!file)
            return system_error("cannot write", path, "check that the folder may be written");
        const bool written =
            bytes.empty() || std::fwrite(bytes.data(), 1, bytes.size(), file.get()) == bytes.size();
        if (!written || std::fflush(file.get()) != 0)
            return system_error("cannot write", path, "check the free space");
    }
    return output.commit();
}

Status write_text_file(const std::string& path, std::string_view text) {
    return write_file(path, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

OutputFile::OutputFile(std::string path)
    : path_(std::move(path)), temporary_(temporary_name(path_)) {
    std::error_code code;  // a folder that cannot be made shows when the file is opened
    const fs::path parent = fs::path(path_).parent_path();
    if (!parent.empty()) fs::create_directories(parent, code);
}

OutputFile::~OutputFile() {
    if (!committed_) std::remove(temporary_.c_str());
}

Status OutputFile::commit() {
    if (std::rename(temporary_.c_str(), path_.c_str()) != 0)
        return system_error("cannot write", path_, "check that the folder may be written");
    committed_ = true;
    return Done{};
}

}  // namespace sonocase::pipeline
