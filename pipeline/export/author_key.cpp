// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/author_key.h"

#include <sodium/randombytes.h>
#include <sodium/utils.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "formats/base/base64.h"

namespace sonocase::pipeline::inline exporting {
namespace {

// What stands before the 32 bytes of a key in DER (RFC 8410, 4 and 7); the same for every key.
constexpr std::array<std::uint8_t, 16> kPrivate{0x30, 0x2e, 0x02, 0x01, 0x00, 0x30, 0x05, 0x06,
                                                0x03, 0x2b, 0x65, 0x70, 0x04, 0x22, 0x04, 0x20};
constexpr std::array<std::uint8_t, 12> kPublic{0x30, 0x2a, 0x30, 0x05, 0x06, 0x03,
                                               0x2b, 0x65, 0x70, 0x03, 0x21, 0x00};
constexpr std::size_t kKeyBytes = 32;
constexpr const char* kExpected =
    "an Ed25519 key, as `sonocase key` or `openssl genpkey -algorithm ed25519` makes it";

using Bytes = std::span<const std::uint8_t>;

std::string pem_of(Bytes head, Bytes key, const std::string& kind, const std::string& name) {
    std::vector<std::uint8_t> der(head.begin(), head.end());
    der.insert(der.end(), key.begin(), key.end());
    return (name.empty() ? "" : "Name: " + name + "\n") + "-----BEGIN " + kind + " KEY-----\n" +
           base64(der) + "\n-----END " + kind + " KEY-----\n";
}

// The 32 bytes of the key between the lines of that kind; nothing: there is no such key.
std::optional<std::array<std::uint8_t, kKeyBytes>> key_in(std::string_view text,
                                                          const std::string& kind,
                                                          Bytes head) {
    const std::string begin = "-----BEGIN " + kind + " KEY-----";
    const std::size_t from = text.find(begin);
    const std::size_t to = text.find("-----END " + kind + " KEY-----");
    if (from == text.npos || to == text.npos || to < from + begin.size()) return std::nullopt;
    const std::string_view inside = text.substr(from + begin.size(), to - from - begin.size());
    if (inside.find('\0') != inside.npos) return std::nullopt;
    std::array<std::uint8_t, 64> der{};
    std::size_t size = 0;
    const bool good =
        sodium_base642bin(der.data(), der.size(), inside.data(), inside.size(), " \t\r\n", &size,
                          nullptr, sodium_base64_VARIANT_ORIGINAL) == 0;
    if (!good || size != head.size() + kKeyBytes ||
        !std::equal(head.begin(), head.end(), der.begin()))
        return std::nullopt;
    std::array<std::uint8_t, kKeyBytes> key{};
    std::copy_n(der.begin() + head.size(), kKeyBytes, key.begin());
    return key;
}

std::string name_in(std::string_view text) {
    constexpr std::string_view kName = "Name: ";
    const std::string_view before = text.substr(0, text.find("-----BEGIN"));
    const std::size_t at = before.find(kName);
    if (at == before.npos || (at > 0 && before[at - 1] != '\n')) return {};
    std::string_view name = before.substr(at + kName.size());
    name = name.substr(0, name.find_first_of("\r\n"));
    return std::string(name);
}

}  // namespace

AuthorKey new_author_key(const std::string& name) {
    AuthorKey out{{}, name};
    randombytes_buf(out.key.seed.data(), out.key.seed.size());
    return out;
}

std::string private_key_text(const AuthorKey& key) {
    return pem_of(kPrivate, key.key.seed, "PRIVATE", key.name);
}

std::string public_key_text(const PublicKey& key, const std::string& name) {
    return pem_of(kPublic, key, "PUBLIC", name);
}

Result<AuthorKey> parse_author_key(std::string_view text, const std::string& where) {
    if (const auto seed = key_in(text, "PRIVATE", kPrivate))
        return AuthorKey{{*seed}, name_in(text)};
    if (text.find("BEGIN ENCRYPTED PRIVATE KEY") != text.npos)
        return Error{"the key is encrypted", where,
                     "decrypt it for this call: openssl pkey -in FILE -out PLAIN"};
    if (text.find("BEGIN PUBLIC KEY") != text.npos)
        return Error{"is the public key, which signs nothing", where, kExpected};
    return Error{"holds no key", where, kExpected};
}

Result<PublicKey> parse_public_key(std::string_view text, const std::string& where) {
    if (const auto key = key_in(text, "PUBLIC", kPublic)) return PublicKey{*key};
    SONOCASE_TRY(const auto own, parse_author_key(text, where));
    return public_key_of(own.key);
}

std::string signature_words(const CaseSignature& signature) {
    const std::string key = " (fingerprint " + fingerprint_of(signature.key) + ")";
    switch (signature.fit) {
        case SignatureFit::none: return {};
        case SignatureFit::fits: return "signed by " + signature.name + key;
        case SignatureFit::differs:
            return "the signature of " + signature.name + key +
                   " does not fit: changed since, or taken from another case";
        case SignatureFit::unreadable: return "has a signature that this program cannot read";
    }
    return {};
}

}  // namespace sonocase::pipeline::inline exporting
