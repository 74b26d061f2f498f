// SPDX-License-Identifier: Apache-2.0

#include "formats/progress_book/progress_book.h"

#include <sqlite3.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string_view>

#include "formats/exercise/metric_table.h"
#include "formats/text/nearest_name.h"
#include "formats/text/number_text.h"

namespace sonocase {
namespace {

namespace fs = std::filesystem;

// 2: seed; 3: attempts of one second stand side by side; 4: exam, checklists, answers
constexpr int kVersion = 4;
constexpr int kApplication = 0x534F4E4F;  // "SONO"

constexpr const char* kSessionColumns =
    "(id INTEGER PRIMARY KEY, trainee TEXT NOT NULL, case_name TEXT NOT NULL,"
    " exercise TEXT NOT NULL, started TEXT NOT NULL, recording TEXT NOT NULL, passed INTEGER NOT "
    "NULL, seed INTEGER NOT NULL DEFAULT 0, exam INTEGER NOT NULL DEFAULT 0);";
constexpr const char* kScoreTable =
    "CREATE TABLE score(session INTEGER NOT NULL REFERENCES session(id) ON DELETE CASCADE,"
    " metric TEXT NOT NULL, value REAL NOT NULL, PRIMARY KEY(session, metric)) WITHOUT ROWID;";
constexpr const char* kTablesSince4 =
    "CREATE TABLE item(session INTEGER NOT NULL REFERENCES session(id) ON DELETE CASCADE,"
    " place INTEGER NOT NULL, name TEXT NOT NULL, critical INTEGER NOT NULL, ticked INTEGER NOT "
    "NULL, PRIMARY KEY(session, place)) WITHOUT ROWID;"
    "CREATE TABLE answer(id INTEGER PRIMARY KEY, trainee TEXT NOT NULL, course TEXT NOT NULL,"
    " module TEXT NOT NULL, option INTEGER NOT NULL, UNIQUE(trainee, course, module));";

// A prepared statement. Texts are bound to it, never pasted into it.
class Statement {
  public:
    Statement(sqlite3* db, const char* sql) { sqlite3_prepare_v2(db, sql, -1, &raw_, nullptr); }
    ~Statement() { sqlite3_finalize(raw_); }
    Statement(const Statement&) = delete;
    Statement& operator=(const Statement&) = delete;
    Statement& bind(int at, const std::string& text) {
        sqlite3_bind_text(raw_, at, text.data(), static_cast<int>(text.size()), SQLITE_TRANSIENT);
        return *this;
    }
    Statement& bind(int at, std::int64_t value) {
        sqlite3_bind_int64(raw_, at, value);
        return *this;
    }
    Statement& bind(int at, double value) {
        sqlite3_bind_double(raw_, at, value);
        return *this;
    }
    int step() { return raw_ ? sqlite3_step(raw_) : SQLITE_ERROR; }
    void reset() { sqlite3_reset(raw_); }
    std::string text(int column) const {
        const auto* bytes = reinterpret_cast<const char*>(sqlite3_column_text(raw_, column));
        return bytes ? std::string(bytes,
                                   static_cast<std::size_t>(sqlite3_column_bytes(raw_, column)))
                     : "";
    }
    std::int64_t integer(int column) const { return sqlite3_column_int64(raw_, column); }
    double number(int column) const { return sqlite3_column_double(raw_, column); }

  private:
    sqlite3_stmt* raw_ = nullptr;
};

// The recordings in a folder, and their pictures, whose headers name the trainee.
std::vector<std::string> recordings_of(const std::string& trainee, const fs::path& folder) {
    std::vector<std::string> files;
    std::error_code none;
    for (fs::directory_iterator it(folder, none), end; !none && it != end; it.increment(none)) {
        const std::string file = it->path().string();
        std::error_code gone;
        if (trainee.empty() || !file.ends_with(".igs.mha") ||
            !fs::is_regular_file(it->symlink_status(gone)))
            continue;
        std::string start(8192, '\0');
        std::ifstream in(file, std::ios::binary);
        in.read(start.data(), static_cast<std::streamsize>(start.size()));
        start.resize(static_cast<std::size_t>(in.gcount()));
        if (trainee_in_header(start) == trainee) files.push_back(file);
    }
    return files;
}

// A name that a spreadsheet would run as a formula gets an apostrophe, which it takes for text.
std::string csv_cell(const std::string& given) {
    const bool formula =
        !given.empty() && std::string_view("=+-@\t").find(given[0]) != std::string_view::npos;
    const std::string text = formula ? "'" + given : given;
    if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
    std::string out = "\"";
    for (const char c : text) {
        out += c;
        if (c == '"') out += '"';
    }
    return out + "\"";
}

}  // namespace

struct ProgressBook::Impl {
    sqlite3* db = nullptr;
    std::string path;
    ~Impl() { sqlite3_close(db); }
    bool busy() const {
        const int code = sqlite3_errcode(db) & 0xff;
        return code == SQLITE_BUSY || code == SQLITE_LOCKED;
    }
    // Locks that the file system refuses for another reason than that somebody has them.
    bool cannot_lock() const {
        const int code = sqlite3_extended_errcode(db);
        return code == SQLITE_IOERR_LOCK || code == SQLITE_IOERR_RDLOCK ||
               code == SQLITE_IOERR_UNLOCK || code == SQLITE_IOERR_CHECKRESERVEDLOCK;
    }
    Error fault(const char* doing) const {
        // SQLite says the same of a lock that is held and of one that cannot be had.
        const std::string why = busy() ? "another program has it, or its folder cannot lock files "
                                         "(a network home)"
                                : cannot_lock() ? "its folder cannot lock files (a network home)"
                                                : sqlite3_errmsg(db);
        return {std::string(doing) + ": " + why, path, "earlier sessions are unchanged"};
    }
    bool run(const char* sql) {
        return sqlite3_exec(db, sql, nullptr, nullptr, nullptr) == SQLITE_OK;
    }
    std::int64_t pragma(const char* sql) {
        Statement s(db, sql);
        return s.step() == SQLITE_ROW ? s.integer(0) : -1;
    }
};

ProgressBook::ProgressBook(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ProgressBook::~ProgressBook() = default;
ProgressBook::ProgressBook(ProgressBook&&) noexcept = default;
ProgressBook& ProgressBook::operator=(ProgressBook&&) noexcept = default;

Result<ProgressBook> ProgressBook::open(const std::string& path) {
    std::error_code failed;
    const auto folder = fs::path(path).parent_path();
    if (!folder.empty()) fs::create_directories(folder, failed);
    if (failed) return Error{"cannot create its folder: " + failed.message(), path, ""};
    auto impl = std::make_unique<Impl>();
    impl->path = path;
    if (sqlite3_open_v2(path.c_str(), &impl->db, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE,
                        nullptr) != SQLITE_OK) {
        return impl->fault("cannot open");
    }
    sqlite3_busy_timeout(impl->db, 5000);
    // secure_delete overwrites deleted rows: nothing of a removed trainee stays in the file.
    if (!impl->run("PRAGMA foreign_keys=ON; PRAGMA synchronous=FULL; PRAGMA secure_delete=ON;")) {
        return impl->fault("cannot open");
    }
    const std::int64_t application = impl->pragma("PRAGMA application_id");
    if (impl->busy()) return impl->fault("cannot open");
    const std::int64_t version = impl->pragma("PRAGMA user_version");
    const std::int64_t tables = impl->pragma("SELECT count(*) FROM sqlite_master");
    if (tables < 0) return impl->fault("is not a progress book");
    if (tables == 0 && version == 0) {
        const std::string make = std::string("BEGIN IMMEDIATE; CREATE TABLE session") +
                                 kSessionColumns + kScoreTable + kTablesSince4 +
                                 "PRAGMA application_id=" + std::to_string(kApplication) +
                                 ";PRAGMA user_version=" + std::to_string(kVersion) + ";COMMIT;";
        if (!impl->run(make.c_str())) {
            impl->run("ROLLBACK");
            // Another program may have created it at the same moment.
            if (impl->pragma("PRAGMA user_version") != kVersion)
                return impl->fault("cannot create the book");
        }
    } else if (application != kApplication) {
        return Error{"is a database of another program", path, "name another file"};
    } else if (version > kVersion) {
        return Error{"comes from a newer program (version " + std::to_string(version) + ")", path,
                     "update this one"};
    } else if (version < kVersion) {
        // SQLite cannot take a constraint out of a table: it is copied into one without. Scores go
        // on naming it, as foreign keys are off meanwhile.
        const std::string copy =
            "PRAGMA foreign_keys=OFF; BEGIN IMMEDIATE; CREATE TABLE fresh" +
            std::string(kSessionColumns) +
            "INSERT INTO fresh SELECT id, trainee, case_name, exercise, started, recording, "
            "passed," +
            (version < 2 ? " 0" : " seed") +
            ", 0 FROM session; DROP TABLE session; ALTER TABLE fresh RENAME TO session;" +
            kTablesSince4 + "PRAGMA user_version=" + std::to_string(kVersion) + "; COMMIT;";
        const bool copied = impl->run(copy.c_str());
        if (!copied) impl->run("ROLLBACK");
        impl->run("PRAGMA foreign_keys=ON");
        if (!copied) {
            // Another program may have done it at the same moment.
            if (impl->pragma("PRAGMA user_version") != kVersion)
                return impl->fault("cannot bring the book to this version");
        }
    }
    return ProgressBook(std::move(impl));
}

Status ProgressBook::add(const ProgressEntry& entry) {
    Impl& impl = *impl_;
    if (!impl.run("BEGIN IMMEDIATE")) return impl.fault("cannot store the session");
    const auto give_up = [&]() -> Status {
        const Error error = impl.fault("cannot store the session");
        impl.run("ROLLBACK");
        return error;
    };
    {
        Statement old(impl.db,
                      "DELETE FROM session WHERE trainee=? AND case_name=? AND exercise=? AND"
                      " started=? AND recording=? AND recording<>''");
        old.bind(1, entry.trainee).bind(2, entry.case_name).bind(3, entry.exercise);
        if (old.bind(4, entry.started).bind(5, entry.recording).step() != SQLITE_DONE)
            return give_up();
        Statement row(
            impl.db,
            "INSERT INTO session(trainee, case_name, exercise, started, recording, passed, seed, "
            "exam) VALUES(?,?,?,?,?,?,?,?)");
        row.bind(1, entry.trainee)
            .bind(2, entry.case_name)
            .bind(3, entry.exercise)
            .bind(4, entry.started);
        row.bind(5, entry.recording).bind(6, std::int64_t{entry.passed});
        row.bind(7, static_cast<std::int64_t>(entry.seed)).bind(8, std::int64_t{entry.exam});
        if (row.step() != SQLITE_DONE) return give_up();
        const std::int64_t id = sqlite3_last_insert_rowid(impl.db);
        Statement score(impl.db,
                        "INSERT OR REPLACE INTO score(session, metric, value) VALUES(?,?,?)");
        for (const Metric& metric : entry.metrics) {
            if (!std::isfinite(metric.value)) continue;
            score.reset();
            if (score.bind(1, id).bind(2, metric.name).bind(3, metric.value).step() != SQLITE_DONE)
                return give_up();
        }
        Statement line(
            impl.db, "INSERT INTO item(session, place, name, critical, ticked) VALUES(?,?,?,?,?)");
        for (std::size_t i = 0; i < entry.items.size(); ++i) {
            const CheckedItem& item = entry.items[i];
            line.reset();
            line.bind(1, id).bind(2, static_cast<std::int64_t>(i)).bind(3, item.name);
            line.bind(4, std::int64_t{item.critical}).bind(5, std::int64_t{item.ticked});
            if (line.step() != SQLITE_DONE) return give_up();
        }
    }
    if (!impl.run("COMMIT")) return give_up();
    return Done{};
}

Result<std::vector<ProgressEntry>> ProgressBook::sessions(const std::string& trainee,
                                                          const std::string& exercise) const {
    std::vector<ProgressEntry> entries;
    Statement rows(
        impl_->db,
        "SELECT id, trainee, case_name, exercise, started, recording, passed, seed, exam FROM "
        "session"
        " WHERE (?1='' OR trainee=?1) AND (?2='' OR exercise=?2) ORDER BY started, id");
    rows.bind(1, trainee).bind(2, exercise);
    int state = 0;
    while ((state = rows.step()) == SQLITE_ROW) {
        ProgressEntry e;
        e.id = rows.integer(0);
        e.trainee = rows.text(1);
        e.case_name = rows.text(2);
        e.exercise = rows.text(3);
        e.started = rows.text(4);
        e.recording = rows.text(5);
        e.passed = rows.integer(6) != 0;
        e.seed = static_cast<std::uint64_t>(rows.integer(7));
        e.exam = rows.integer(8) != 0;
        entries.push_back(std::move(e));
    }
    if (state != SQLITE_DONE) return impl_->fault("cannot read");
    Statement scores(impl_->db, "SELECT metric, value FROM score WHERE session=?");
    Statement lines(impl_->db,
                    "SELECT name, critical, ticked FROM item WHERE session=? ORDER BY place");
    for (ProgressEntry& e : entries) {
        scores.reset();
        scores.bind(1, e.id);
        std::map<std::string, double> values;
        while ((state = scores.step()) == SQLITE_ROW) values[scores.text(0)] = scores.number(1);
        if (state != SQLITE_DONE) return impl_->fault("cannot read");
        for (const MetricInfo& info : metric_table()) {
            const auto found = values.find(info.name);
            if (found != values.end()) e.metrics.push_back({info.name, found->second});
        }
        lines.reset();
        lines.bind(1, e.id);
        while ((state = lines.step()) == SQLITE_ROW)
            e.items.push_back({lines.text(0), lines.integer(1) != 0, lines.integer(2) != 0});
        if (state != SQLITE_DONE) return impl_->fault("cannot read");
    }
    return entries;
}

Status ProgressBook::add(const CourseAnswer& answer) {
    Statement row(impl_->db,
                  "INSERT OR REPLACE INTO answer(trainee, course, module, option) VALUES(?,?,?,?)");
    row.bind(1, answer.trainee).bind(2, answer.course).bind(3, answer.module);
    if (row.bind(4, std::int64_t{answer.option}).step() != SQLITE_DONE)
        return impl_->fault("cannot store the answer");
    return Done{};
}

Result<std::vector<CourseAnswer>> ProgressBook::answers(const std::string& trainee) const {
    std::vector<CourseAnswer> all;
    Statement rows(impl_->db,
                   "SELECT trainee, course, module, option FROM answer WHERE (?1='' OR trainee=?1)"
                   " ORDER BY id");
    rows.bind(1, trainee);
    int state = 0;
    while ((state = rows.step()) == SQLITE_ROW)
        all.push_back(
            {rows.text(0), rows.text(1), rows.text(2), static_cast<int>(rows.integer(3))});
    if (state != SQLITE_DONE) return impl_->fault("cannot read");
    return all;
}

Result<std::vector<std::string>> ProgressBook::trainees() const {
    std::vector<std::string> names;
    Statement rows(impl_->db, "SELECT DISTINCT trainee FROM session ORDER BY trainee");
    int state = 0;
    while ((state = rows.step()) == SQLITE_ROW) names.push_back(rows.text(0));
    if (state != SQLITE_DONE) return impl_->fault("cannot read");
    return names;
}

Status ProgressBook::expect_trainee(const std::string& trainee) const {
    SONOCASE_TRY(auto names, trainees());
    SONOCASE_TRY(const auto given, answers(""));
    for (const CourseAnswer& answer : given) names.push_back(answer.trainee);
    if (std::find(names.begin(), names.end(), trainee) != names.end()) return Done{};
    const std::string nearest = nearest_name(trainee, names);
    return Error{"has no trainee '" + trainee + "'", impl_->path,
                 nearest.empty() ? "" : "did you mean '" + nearest + "'?"};
}

Result<RemovedTrainee> ProgressBook::remove_trainee(const std::string& trainee) {
    RemovedTrainee removed;
    const fs::path folder = fs::path(impl_->path).parent_path() / "sessions";
    SONOCASE_TRY(const auto entries, sessions(trainee, ""));
    std::set<std::string> recordings;
    for (const ProgressEntry& e : entries) {
        if (e.trainee != trainee) continue;
        ++removed.sessions;
        if (!e.recording.empty()) recordings.insert(e.recording);
    }
    // Attempts that were too short for the book, and those of a book that is gone.
    for (const std::string& file : recordings_of(trainee, folder)) recordings.insert(file);
    if (recordings.empty()) SONOCASE_TRY_DONE(expect_trainee(trainee));
    const auto remove = [&removed](const std::string& file) {
        std::error_code failed;
        const bool gone = fs::remove(file, failed);
        if (failed) removed.not_deleted.push_back(file);
        return gone;
    };
    for (const std::string& recording : recordings) {
        // Pictures are listed by themselves where their recording was deleted by hand.
        const bool pictures = recording.ends_with(".frames.igs.mha");
        if (remove(recording) && !pictures) ++removed.recordings;
        if (pictures) continue;
        remove(recording + ".scores.json");
        const std::string_view ending = recording.ends_with(".igs.mha") ? ".igs.mha" : ".mha";
        if (!recording.ends_with(ending)) continue;
        const std::string stem = recording.substr(0, recording.size() - ending.size());
        remove(stem + ".frames.igs.mha");
        const std::string review = stem + ".review";
        std::error_code none;
        if (!fs::equivalent(fs::path(review).parent_path(), folder, none) ||
            !fs::is_directory(fs::symlink_status(review, none)))
            continue;
        if (remove(review + "/review.html")) ++removed.reviews;
        remove(review + "/scores.json");
        fs::remove(review, none);  // stays where it has files of others
    }
    for (const char* sql :
         {"DELETE FROM session WHERE trainee=?", "DELETE FROM answer WHERE trainee=?"}) {
        Statement rows(impl_->db, sql);
        if (rows.bind(1, trainee).step() != SQLITE_DONE) return impl_->fault("cannot remove");
    }
    return removed;
}

Result<std::string> ProgressBook::csv(const std::string& trainee,
                                      const std::string& exercise) const {
    SONOCASE_TRY(const auto entries, sessions(trainee, exercise));
    std::string out = "trainee,case,exercise,started,passed,seed";
    for (const MetricInfo& info : metric_table()) out += std::string(",") + info.name;
    out += "\r\n";
    for (const ProgressEntry& e : entries) {
        out += csv_cell(e.trainee) + "," + csv_cell(e.case_name) + "," + csv_cell(e.exercise) +
               "," + csv_cell(e.started) + "," + (e.passed ? "1" : "0") + "," +
               std::to_string(e.seed);
        std::size_t next = 0;
        for (const MetricInfo& info : metric_table()) {
            out += ',';
            if (next < e.metrics.size() && e.metrics[next].name == info.name) {
                append_number(out, e.metrics[next++].value);
            }
        }
        out += "\r\n";
    }
    return out;
}

std::vector<CheckedItem> checked_items(const SessionScore& score) {
    std::vector<CheckedItem> items;
    if (!score.procedure) return items;
    for (const ProcedureResult::Item& item : score.procedure->items)
        items.push_back({item.name, item.critical, item.ticked});
    return items;
}

ProgressEntry progress_entry(const SessionHeader& header,
                             const SessionScore& score,
                             const std::string& recording) {
    ProgressEntry entry;
    entry.trainee = header.trainee;
    entry.case_name = header.case_name;
    entry.exercise = header.exercise;
    entry.started = header.started;
    entry.recording = recording;
    entry.passed = score.passed;
    entry.seed = attempt_seed(header);
    entry.exam = detail_value(header.attempt, "mode") == "exam";
    for (const Metric& metric : score.metrics) {
        if (std::isfinite(metric.value)) entry.metrics.push_back(metric);
    }
    entry.items = checked_items(score);
    return entry;
}

std::string default_progress_path() {
    const char* data = std::getenv("XDG_DATA_HOME");
    const char* home = std::getenv("HOME");
    const std::string base =
        data && *data == '/' ? data : std::string(home ? home : ".") + "/.local/share";
    return base + "/sonocase/progress.sqlite";
}

}  // namespace sonocase
