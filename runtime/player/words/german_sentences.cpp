// SPDX-License-Identifier: Apache-2.0

// German: sentences.
#include "runtime/player/words/german.h"

namespace sonocase::runtime {

std::span<const Translation> german_sentences() {
    static constexpr Translation kWords[] = {
        {"%s may need help with %s: %d attempts, no pass.",
         "%s braucht vielleicht Hilfe bei %s: %d Versuche, keiner bestanden."},
        {"3-D view from outside, from the probe, from the needle",
         "3D-Ansicht von außen, vom Schallkopf, von der Nadel"},
        {"3-D view shown or not; in the place of the picture",
         "3D-Ansicht gezeigt oder nicht; an der Stelle des Bildes"},
        {"Aim at the target before the needle enters the skin, and keep the line.",
         "Zielen Sie, bevor die Nadel in die Haut eintritt, und halten Sie die Linie."},
        {"Aim at the target before the needle enters the skin.",
         "Zielen Sie, bevor die Nadel in die Haut eintritt."},
        {"Aim outside the skin first; correct the angle before the needle enters.",
         "Zielen Sie zuerst außerhalb der Haut; korrigieren Sie den Winkel vor dem "
         "Einstich."},
        {"Angle between needle and scan plane, mean in tissue",
         "Winkel zwischen Nadel und Bildebene, Mittel im Gewebe"},
        {"As a TOML file beside the case; it is among the exercises at once",
         "Als TOML-Datei neben dem Fall; sie ist sofort unter den Übungen"},
        {"Before you advance, look for vessels and bowel on the way, and choose another "
         "entry if they lie on it.",
         "Suchen Sie vor dem Vorschieben Gefäße und Darm auf dem Weg, und wählen Sie "
         "sonst einen anderen Einstich."},
        {"Changes places with the picture (Shift + V)",
         "Tauscht den Platz mit dem Bild (Umschalt + V)"},
        {"Do it again: %d passes in a row count as mastered; this was %d.",
         "Noch einmal: %d bestandene in Folge gelten als sicher beherrscht; dies war "
         "Nummer %d."},
        {"Drag the picture, or use the arrow keys, until the anatomy has moved by a few "
         "centimetres.",
         "Ziehen Sie am Bild oder nehmen Sie die Pfeiltasten, bis die Anatomie um "
         "einige Zentimeter gewandert ist."},
        {"Drag with the right button, or hold Shift with the arrow keys: the probe fans "
         "and rocks about its place.",
         "Ziehen Sie mit der rechten Taste, oder halten Sie Umschalt mit den "
         "Pfeiltasten: der Schallkopf kippt auf der Stelle."},
        {"Exam: no hints, no distances, no target drawn. It counts.",
         "Prüfung: keine Hinweise, keine Abstände, kein Ziel eingezeichnet. Sie zählt."},
        {"Five guided minutes: slide, tilt, hold, take the needle, advance.",
         "Fünf geführte Minuten: schieben, kippen, anhalten, Nadel nehmen, vorschieben."},
        {"From outside, from the probe, from the needle (O)",
         "Von außen, vom Schallkopf, von der Nadel (O)"},
        {"Go on until the tip lies in the middle of the target, and check it by rocking "
         "the probe.",
         "Gehen Sie weiter, bis die Spitze mitten im Ziel liegt, und prüfen Sie es "
         "durch Kippen des Schallkopfs."},
        {"Go straight to the target; pull back to the skin before you change direction.",
         "Gehen Sie gerade zum Ziel; ziehen Sie bis zur Haut zurück, bevor Sie die "
         "Richtung ändern."},
        {"Hold W to push and S to pull. Watch the bright line: its end is the tip.",
         "W schiebt vor, S zieht zurück. Achten Sie auf die helle Linie: ihr Ende ist "
         "die Spitze."},
        {"Hold the probe still while the needle moves, and the needle still while you "
         "look.",
         "Halten Sie den Schallkopf ruhig, solange sich die Nadel bewegt, und die "
         "Nadel, solange Sie suchen."},
        {"Hold the probe with less pressure: tissue and veins keep their shape.",
         "Drücken Sie den Schallkopf weniger an: Gewebe und Venen behalten ihre Form."},
        {"Holds the picture; the last 20 s can be looked through",
         "Hält das Bild an; die letzten 20 s lassen sich durchsehen"},
        {"How far the probe presses in (Page Down, Page Up)",
         "Wie weit der Schallkopf eindrückt (Bild ab, Bild auf)"},
        {"Mastered. Go on to the next exercise, or try it as an exam.",
         "Beherrscht. Weiter mit der nächsten Übung, oder diese als Prüfung."},
        {"No case was found. Drop one here, or copy it to",
         "Kein Fall gefunden. Legen Sie einen hier ab, oder kopieren Sie ihn nach"},
        {"Nobody has signed in yet. Attempts of trainees with a name appear here.",
         "Noch hat sich niemand angemeldet. Versuche mit Namen erscheinen hier."},
        {"Not fitted here: the mannequin was not swept",
         "Hier nicht angepasst: die Puppe wurde nicht abgetastet"},
        {"Opens it; Start practice begins an attempt at once",
         "Öffnet sie; Übung starten beginnt sofort einen Versuch"},
        {"Plan the path before the needle enters, then advance without pauses.",
         "Planen Sie den Weg vor dem Einstich, und schieben Sie dann ohne Pausen vor."},
        {"Press N: the needle lies beside the probe, in the plane of the picture. A and "
         "D aim it.",
         "Drücken Sie N: die Nadel liegt neben dem Schallkopf in der Bildebene. A und D "
         "richten sie."},
        {"Press Space or Freeze to hold the picture, look back with the bar below it, "
         "then press again.",
         "Leertaste oder Standbild hält das Bild an; blättern Sie mit der Leiste "
         "darunter zurück, dann drücken Sie noch einmal."},
        {"Press gently before you puncture: a vein closes, an artery keeps its shape.",
         "Drücken Sie vor dem Einstich sanft: eine Vene schließt sich, eine Arterie "
         "behält ihre Form."},
        {"Read the depth of the target from the scale before you advance.",
         "Lesen Sie die Tiefe des Ziels an der Skala ab, bevor Sie vorschieben."},
        {"Removes this trainee's attempts and recordings from this machine",
         "Entfernt Versuche und Aufnahmen dieser Person von diesem Rechner"},
        {"Saves the last 20 s as a film (Shift + F12)",
         "Speichert die letzten 20 s als Film (Umschalt + F12)"},
        {"Scanning goes on by itself when it answers.",
         "Es geht von selbst weiter, sobald er antwortet."},
        {"Slide the probe over the whole organ before you choose an entry.",
         "Fahren Sie das ganze Organ ab, bevor Sie den Einstich wählen."},
        {"Start the attempt with B. Find the target, bring the needle into the picture, "
         "and stop in its middle.",
         "Starten Sie den Versuch mit B. Finden Sie das Ziel, bringen Sie die Nadel ins "
         "Bild, und halten Sie in seiner Mitte."},
        {"Tilt the probe along the vessel or steer the box until beam and flow are off a right "
         "angle.",
         "Kippen Sie den Schallkopf längs des Gefäßes, oder schwenken Sie das Farbfenster, bis "
         "Strahl und Fluss nicht mehr senkrecht stehen."},
        {"Lay the gate into each vessel and hold still for two heartbeats.",
         "Legen Sie das Messfenster in jedes Gefäß, und halten Sie zwei Herzschläge still."},
        {"Tell artery from vein by colour and pulse before you lay the gate.",
         "Unterscheiden Sie Arterie und Vene an Farbe und Puls, bevor Sie das Messfenster legen."},
        {"Lay the gate into the middle of the vessel, no longer than its lumen.",
         "Legen Sie das Messfenster in die Mitte des Gefäßes, nicht länger als seine Lichtung."},
        {"Tilt the probe or steer until beam and flow are less than 60 degrees apart.",
         "Kippen oder schwenken Sie, bis Strahl und Fluss weniger als 60 Grad auseinanderliegen."},
        {"Turn the angle cursor until it lies along the vessel.",
         "Drehen Sie den Winkelcursor, bis er längs des Gefäßes liegt."},
        {"Stop as soon as the tip shows inside the vessel, and flatten the needle "
         "before you go on.",
         "Halten Sie an, sobald die Spitze im Gefäß erscheint, und senken Sie die Nadel "
         "ab, bevor Sie weitergehen."},
        {"Stop in the middle of the target: rock the probe over the tip before you "
         "finish.",
         "Halten Sie mitten im Ziel: kippen Sie den Schallkopf über der Spitze, bevor "
         "Sie beenden."},
        {"Stop pushing as soon as the tip fades; fan the probe until it is bright, then "
         "go on.",
         "Halten Sie an, sobald die Spitze verblasst; fächern Sie mit dem Schallkopf, "
         "bis sie hell ist, dann weiter."},
        {"The last 20 s; frozen, any of them can be looked at (comma, full stop)",
         "Die letzten 20 s; im Standbild ist jedes zu sehen (Komma, Punkt)"},
        {"The target gets a new place, and the time starts",
         "Das Ziel bekommt einen neuen Ort, und die Zeit läuft"},
        {"This exercise has no pass marks: compare the measures with your own.",
         "Diese Übung hat keine Vorgaben: vergleichen Sie die Messgrößen mit Ihren "
         "eigenen."},
        {"This size does not fit the window; it is shown at",
         "Diese Größe passt nicht ins Fenster; gezeigt wird"},
        {"Tracker, and time from movement to picture (F9)",
         "Tracker, und Zeit von der Bewegung zum Bild (F9)"},
        {"Turn the probe until the whole shaft lies in the picture, then advance.",
         "Drehen Sie den Schallkopf, bis der ganze Schaft im Bild liegt, dann schieben "
         "Sie vor."},
        {"What was done, beside the straight way (dotted). The bar below the picture "
         "goes to any moment, at any speed.",
         "Was getan wurde, neben dem geraden Weg (gepunktet). Die Leiste unter dem Bild "
         "führt zu jedem Augenblick, in jedem Tempo."},
        {"next exercise, image model, tracker; Shift goes back",
         "nächste Übung, Bildmodell, Tracker; Umschalt geht zurück"},
        {"on the picture: slide, tilt, rotate; Ctrl + wheel presses",
         "im Bild: schieben, kippen, drehen; Strg + Rad drückt"},
        {"on the start page practise; after an attempt again, replay, review",
         "auf der Startseite üben; nach einem Versuch noch einmal, Wiedergabe, "
         "Auswertung"},
        {"save the picture; save the last 20 s as a film",
         "Bild speichern; die letzten 20 s als Film speichern"},
        {"slide on the skin; with Alt everything is slow",
         "auf der Haut schieben; mit Alt ist alles langsam"},
        {"start and finish an attempt; next hint in practice",
         "einen Versuch beginnen und beenden; nächster Hinweis in der Übung"},
        {"walk through the controls; press the one in its frame",
         "durch die Bedienelemente gehen; das gerahmte drücken"},
        {"Well done. This was an easier attempt; the next is harder, and attempts as hard as "
         "the exercise is written count towards mastery.",
         "Gut gemacht. Dies war ein leichterer Versuch; der nächste ist schwerer, und für die "
         "Beherrschung zählen Versuche, die so schwer sind wie die Übung geschrieben ist."},
    };
    return kWords;
}

}  // namespace sonocase::runtime
