// SPDX-License-Identifier: Apache-2.0

#include "pipeline/publish/publish.h"

#include <filesystem>
#include <set>
#include <utility>

#include "formats/files/atomic_file.h"
#include "pipeline/publish/site_list.h"

namespace sonocase::pipeline {

namespace fs = std::filesystem;

namespace {

constexpr const char* kProgramFiles[] = {"style.css", "sonoplay.js", "sonoplay.wasm",
                                         "sonoplay-scalar.wasm", "worker.js"};
constexpr std::size_t kLargeSinglePage = 12 << 20;  // bytes of a case; base64 adds a third

std::string base64(std::span<const std::uint8_t> bytes) {
    static constexpr char kDigits[] =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    out.reserve(bytes.size() / 3 * 4 + 4);
    for (std::size_t n = 0; n < bytes.size(); n += 3) {
        std::uint32_t word = static_cast<std::uint32_t>(bytes[n]) << 16;
        if (n + 1 < bytes.size()) word |= static_cast<std::uint32_t>(bytes[n + 1]) << 8;
        if (n + 2 < bytes.size()) word |= bytes[n + 2];
        for (int k = 3; k >= 0; --k) out += kDigits[word >> 6 * k & 63];
    }
    const std::size_t missing = (3 - bytes.size() % 3) % 3;
    out.replace(out.size() - missing, missing, missing, '=');
    return out;
}

// Data inside a page: nothing in it may end the element that holds it.
std::string inside_page(std::string text) {
    for (std::size_t at = 0; (at = text.find('<', at)) != text.npos;)
        text.replace(at, 1, "\\u003c");
    return text;
}

Status replace_once(std::string& text, const std::string& what, const std::string& by) {
    const std::size_t at = text.find(what);
    if (at == text.npos) {
        return Error{"the page has no place '" + what + "'", "",
                     "build it anew with scripts/web of this version"};
    }
    text.replace(at, what.size(), by);
    return Done{};
}

bool is_plain(const std::string& origin) {
    return origin.find_first_not_of(
               "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-:/") == origin.npos;
}
std::string without_path(const std::string& address) {
    const std::size_t scheme = address.find("://");
    return scheme == address.npos ? "" : address.substr(0, address.find('/', scheme + 3));
}

// "https://store.example.org" of a store's address.
Result<std::string> store_origin(const std::string& address) {
    const std::string origin = without_path(address);
    const bool local =
        origin.starts_with("http://127.0.0.1:") || origin.starts_with("http://localhost:");
    if (!is_plain(origin) || (!origin.starts_with("https://") && !local)) {
        return Error{"'" + address + "' is not the address of a learning record store", "--xapi",
                     "expected https://HOST/PATH"};
    }
    return origin;
}

// "ws://127.0.0.1:18946" of a pose server's address.
Result<std::string> pose_origin(const std::string& address) {
    const std::string origin = without_path(address);
    if (!is_plain(origin) || (!origin.starts_with("ws://") && !origin.starts_with("wss://"))) {
        return Error{"'" + address + "' is not the address of a pose server", "--poses",
                     "expected ws://HOST:PORT"};
    }
    return origin;
}

// The hosts that the page may talk to besides its own.
Result<std::string> other_hosts(const PublishOptions& options) {
    std::string out;
    if (!options.xapi.empty()) {
        const auto origin = store_origin(options.xapi);
        if (!origin) return origin.error();
        out += " " + *origin;
    }
    if (!options.poses.empty()) {
        const auto origin = pose_origin(options.poses);
        if (!origin) return origin.error();
        out += " " + *origin;
    }
    return out;
}

Result<std::vector<ReadCase>> read_cases(const std::vector<std::string>& paths) {
    std::vector<ReadCase> out;
    std::set<std::string> names;
    for (const std::string& path : paths) {
        auto bytes = read_large_file(path);
        if (!bytes) return bytes.error();
        auto read = site_case(*bytes, path);
        if (!read) return read.error();
        if (!names.insert(read->site.name).second) {
            return Error{"two cases are named " + read->site.name, path, "rename one of the files"};
        }
        out.push_back(std::move(*read));
    }
    return out;
}

Result<Published> publish_page(const std::vector<ReadCase>& cases,
                               const std::string& program,
                               const std::string& path,
                               const PublishOptions& options) {
    if (cases.size() != 1) {
        return Error{"one page holds one case, and " + std::to_string(cases.size()) + " are given",
                     "--single-file", "give one case"};
    }
    auto page = read_text_file(program + "/single.html");
    if (!page) return page.error();
    SiteCase site = cases[0].site;
    site.preview.clear();
    const std::string list = "<script type=\"application/json\" id=\"site-list\">" +
                             inside_page(site_list_json({site}, options.xapi)) + "</script>";
    const std::string data = "<script type=\"text/plain\" id=\"case-" + site.name + "\">" +
                             base64(cases[0].bytes) + "</script>";
    const auto hosts = other_hosts(options);
    if (!hosts) return hosts.error();
    if (!hosts->empty()) {
        if (Status s = replace_once(*page, "connect-src 'none'", "connect-src" + *hosts); !s)
            return s.error();
    }
    if (Status s = replace_once(*page, "<!--LIST-->", list); !s) return s.error();
    if (Status s = replace_once(*page, "<!--CASES-->", data); !s) return s.error();
    if (Status s = write_file(path, *page); !s) return s.error();
    Published out{{path}, {}};
    if (cases[0].bytes.size() > kLargeSinglePage) {
        out.warnings.push_back(
            "The case is large for one page: browsers take seconds to open it. A case cooked with "
            "--preset draft is smaller.");
    }
    return out;
}

}  // namespace

Result<std::string> find_program() {
    std::error_code failed;
    const fs::path self = fs::read_symlink("/proc/self/exe", failed);
    const fs::path bin = self.parent_path();
    for (const fs::path& folder : {bin / "../share/sonocase/web", bin / "../../web/program"}) {
        if (fs::is_regular_file(folder / "sonoplay.wasm", failed))
            return fs::weakly_canonical(folder, failed).string();
    }
    return Error{"the player for browsers is not built", "",
                 "build it with scripts/web, or name its folder with --program"};
}

Result<Published> publish(const std::vector<std::string>& cases,
                          const std::string& site,
                          const PublishOptions& options) {
    std::string program = options.program_folder;
    if (program.empty()) {
        auto found = find_program();
        if (!found) return found.error();
        program = std::move(*found);
    }
    const auto read = read_cases(cases);
    if (!read) return read.error();
    if (options.single_file) return publish_page(*read, program, site, options);

    auto index = read_text_file(program + "/index.html");
    if (!index) return index.error();
    const auto hosts = other_hosts(options);
    if (!hosts) return hosts.error();
    if (!hosts->empty()) {
        if (Status s = replace_once(*index, "connect-src 'self'", "connect-src 'self'" + *hosts);
            !s)
            return s.error();
    }
    Published out;
    Status written = Done{};
    const auto write = [&](const std::string& name, const auto& content) {
        if (!written) return;
        written = write_file(site + "/" + name, content);
        if (written) out.files.push_back(site + "/" + name);
    };
    std::vector<SiteCase> list;
    for (const ReadCase& one : *read) {
        write(one.site.file, std::span<const std::uint8_t>(one.bytes));
        write(one.site.file + ".segments", std::span<const std::uint8_t>(segment_list(one.site)));
        if (!one.site.preview.empty())
            write(one.site.name + ".png", std::span<const std::uint8_t>(one.site.preview));
        list.push_back(one.site);
    }
    for (const char* name : kProgramFiles) {
        const auto bytes = read_file(program + "/" + name);
        if (!bytes) return bytes.error();
        write(name, std::span<const std::uint8_t>(*bytes));
    }
    write("index.html", std::string_view(*index));
    write("cases.json", std::string_view(site_list_json(list, options.xapi)));
    if (!written) return written.error();
    return out;
}

}  // namespace sonocase::pipeline
