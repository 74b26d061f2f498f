// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/signature.h"

#include <sodium/crypto_hash_sha512.h>
#include <sodium/crypto_sign_ed25519.h>

#include <algorithm>
#include <cstring>

#include "formats/bundle/codec/chunk_file.h"

namespace sonocase {
namespace {

constexpr std::string_view kChunk = "signed";
constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kMaxName = 128;
constexpr std::size_t kHead = sizeof kVersion + crypto_sign_ed25519_PUBLICKEYBYTES +
                              crypto_sign_ed25519_BYTES;  // the name follows
constexpr std::size_t kStep = std::size_t{1} << 20;
using Sha512 = std::array<std::uint8_t, crypto_hash_sha512_BYTES>;

std::string hex_of(std::span<const std::uint8_t> bytes) {
    std::string out;
    for (const std::uint8_t b : bytes) {
        out += "0123456789abcdef"[b >> 4];
        out += "0123456789abcdef"[b & 15];
    }
    return out;
}

std::string statement_head(std::string_view name) {
    return "sonocase case signature 1\nname " + std::string(name) + "\n";
}

std::string statement_line(const ChunkReader& reader,
                           const std::string& type,
                           std::size_t bytes,
                           const Sha512& hash) {
    return "chunk " + type + (reader.is_required(type) ? " required " : " optional ") +
           std::to_string(bytes) + " " + hex_of(hash) + "\n";
}

// All chunks but the signature, by name.
std::vector<std::string> signed_types(std::span<const std::uint8_t> file) {
    std::vector<std::string> types = chunk_types(file);
    std::erase(types, kChunk);
    std::sort(types.begin(), types.end());
    return types;
}

}  // namespace

bool can_sign_as(std::string_view name) {
    if (name.empty() || name.size() > kMaxName) return false;
    for (std::size_t at = 0; at < name.size();) {
        const auto byte = [&](std::size_t n) {
            return at + n < name.size() ? static_cast<std::uint8_t>(name[at + n]) : std::uint8_t{};
        };
        const std::uint8_t lead = byte(0);
        const std::size_t more = lead < 0x80                   ? 0
                                 : lead >= 0xC2 && lead < 0xE0 ? 1
                                 : lead >= 0xE0 && lead < 0xF0 ? 2
                                 : lead >= 0xF0 && lead < 0xF5 ? 3
                                                               : 4;
        if (more == 4) return false;
        std::uint32_t code = more == 0 ? lead : lead & (0x3Fu >> more);
        for (std::size_t n = 1; n <= more; ++n) {
            if ((byte(n) & 0xC0) != 0x80) return false;
            code = code << 6 | (byte(n) & 0x3Fu);
        }
        const bool too_long = (more == 2 && code < 0x800) || (more == 3 && code < 0x10000);
        const bool control = code < 0x20 || (code >= 0x7F && code < 0xA0) ||
                             (code >= 0x200B && code <= 0x200F) ||
                             (code >= 0x2028 && code <= 0x202E) ||
                             (code >= 0x2060 && code <= 0x206F) || code == 0xFEFF;
        const bool none = (code >= 0xD800 && code < 0xE000) || code > 0x10FFFF;
        if (too_long || control || none) return false;
        at += more + 1;
    }
    return true;
}

PublicKey public_key_of(const SigningKey& key) {
    PublicKey out{};
    std::array<std::uint8_t, crypto_sign_ed25519_SECRETKEYBYTES> secret{};
    crypto_sign_ed25519_seed_keypair(out.data(), secret.data(), key.seed.data());
    return out;
}

std::string fingerprint_of(const PublicKey& key) {
    Sha512 hash{};
    crypto_hash_sha512(hash.data(), key.data(), key.size());
    std::string out;
    for (std::size_t at = 0; at < 16; at += 2)
        out += (at == 0 ? "" : " ") + hex_of(std::span(hash).subspan(at, 2));
    return out;
}

struct SignatureCheck::State {
    ChunkReader reader;
    std::vector<std::string> types;
    std::array<std::uint8_t, crypto_sign_ed25519_BYTES> signature{};
    std::string statement;
    // `next` is the first of `types` whose chunk has not been read to its end.
    std::size_t next = 0, at = 0;
    bool loaded = false;
    std::vector<std::uint8_t> unpacked = {};
    std::span<const std::uint8_t> content = {};
    crypto_hash_sha512_state hash{};

    // False: the chunk cannot be read.
    bool load() {
        const std::string& type = types[next];
        at = 0;
        loaded = true;
        crypto_hash_sha512_init(&hash);
        if (!reader.is_compressed(type)) {
            const auto stored = reader.packed(type);
            if (stored) content = *stored;
            return stored.has_value();
        }
        auto read = reader.read(type, reader.raw_bytes(type));
        if (read) content = unpacked = std::move(*read);
        return read.has_value();
    }
};

SignatureCheck::SignatureCheck(std::span<const std::uint8_t> file) {
    const std::vector<std::string> all = chunk_types(file);
    if (std::find(all.begin(), all.end(), kChunk) == all.end()) return;
    result_.fit = SignatureFit::unreadable;
    const std::vector<std::string_view> known(all.begin(), all.end());
    auto reader = ChunkReader::open(file, "CASE", known, "");
    if (!reader) return;
    const auto raw = reader->read(kChunk, kHead + kMaxName);
    if (!raw || raw->size() <= kHead) return;
    std::uint32_t version = 0;
    std::memcpy(&version, raw->data(), sizeof version);
    const std::string name(raw->begin() + kHead, raw->end());
    if (version != kVersion || !can_sign_as(name)) return;
    result_.fit = SignatureFit::differs;
    result_.name = name;
    std::copy_n(raw->begin() + sizeof version, result_.key.size(), result_.key.begin());
    std::vector<std::string> types = signed_types(file);
    // A name that the reader does not take as it stands: nobody reads it, and nobody signed it.
    if (!std::all_of(types.begin(), types.end(), [&](const auto& t) { return reader->has(t); }))
        return;
    state_.reset(new State{.reader = std::move(*reader),
                           .types = std::move(types),
                           .statement = statement_head(name)});
    std::copy_n(raw->begin() + sizeof version + result_.key.size(), state_->signature.size(),
                state_->signature.begin());
}

SignatureCheck::~SignatureCheck() = default;
SignatureCheck::SignatureCheck(SignatureCheck&&) noexcept = default;
SignatureCheck& SignatureCheck::operator=(SignatureCheck&&) noexcept = default;

bool SignatureCheck::step() {
    if (!state_) return true;
    State& s = *state_;
    if (s.next == s.types.size()) {
        const bool good =
            crypto_sign_ed25519_verify_detached(
                s.signature.data(), reinterpret_cast<const unsigned char*>(s.statement.data()),
                s.statement.size(), result_.key.data()) == 0;
        if (good) result_.fit = SignatureFit::fits;
        state_.reset();
        return true;
    }
    if (!s.loaded && !s.load()) {  // damaged: what was signed is not there
        state_.reset();
        return true;
    }
    const auto part = s.content.subspan(s.at, std::min(kStep, s.content.size() - s.at));
    crypto_hash_sha512_update(&s.hash, part.data(), part.size());
    s.at += part.size();
    if (s.at < s.content.size()) return false;
    Sha512 hash{};
    crypto_hash_sha512_final(&s.hash, hash.data());
    s.statement += statement_line(s.reader, s.types[s.next++], s.content.size(), hash);
    s.loaded = false;
    return false;
}

CaseSignature signature_of(std::span<const std::uint8_t> file) {
    SignatureCheck check(file);
    while (!check.step()) {
    }
    return check.result();
}

Result<std::vector<std::uint8_t>> signed_case(std::span<const std::uint8_t> file,
                                              const SigningKey& key,
                                              std::string_view name,
                                              const std::string& where,
                                              JobRunner& jobs) {
    if (!can_sign_as(name))
        return Error{"'" + std::string(name) + "' cannot be an author's name", where,
                     "1 to 128 bytes of text in one line"};
    const std::vector<std::string> types = chunk_types(file);
    const std::vector<std::string_view> known(types.begin(), types.end());
    SONOCASE_TRY(const auto reader, ChunkReader::open(file, "CASE", known, where));
    ChunkWriter writer("CASE");
    for (const std::string& type : types) {
        if (type == kChunk) continue;
        if (reader.is_compressed(type)) {
            SONOCASE_TRY(auto raw, reader.read(type, reader.raw_bytes(type), jobs));
            writer.add(type, reader.is_required(type), std::move(raw));
        } else {
            SONOCASE_TRY(const auto stored, reader.packed(type));
            writer.add_packed(type, reader.is_required(type),
                              std::vector<std::uint8_t>(stored.begin(), stored.end()));
        }
    }
    std::string statement = statement_head(name);
    for (const std::string& type : signed_types(file)) {
        SONOCASE_TRY(const auto raw, reader.read(type, reader.raw_bytes(type), jobs));
        Sha512 hash{};
        crypto_hash_sha512(hash.data(), raw.data(), raw.size());
        statement += statement_line(reader, type, raw.size(), hash);
    }
    PublicKey open{};
    std::array<std::uint8_t, crypto_sign_ed25519_SECRETKEYBYTES> secret{};
    crypto_sign_ed25519_seed_keypair(open.data(), secret.data(), key.seed.data());
    std::vector<std::uint8_t> chunk(kHead);
    std::memcpy(chunk.data(), &kVersion, sizeof kVersion);
    std::copy(open.begin(), open.end(), chunk.begin() + sizeof kVersion);
    crypto_sign_ed25519_detached(chunk.data() + sizeof kVersion + open.size(), nullptr,
                                 reinterpret_cast<const unsigned char*>(statement.data()),
                                 statement.size(), secret.data());
    chunk.insert(chunk.end(), name.begin(), name.end());
    writer.add_packed(std::string(kChunk), false, std::move(chunk));
    return writer.write(jobs);
}

}  // namespace sonocase
