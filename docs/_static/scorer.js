// How results of the search are ordered: guides before explanation, and both before keys and public names.
// A name that nobody types by chance (`ramp_down_s`, `rig.run`) still leads to itself first.

const PLACES = [
  [/\/index$|^index$|^glossary$/, -6],
  [/^(tutorials|how-to)\/|^cite$/, 10],
  [/^explanation\//, 6],
  [/^reference\/messages\//, 4],
  [/^reference\/(keys|api)\//, -2],
  [/^reference\//, 3],
  [/^decisions\//, -4],
];

var Scorer = {
  score: ([page, title, , , score, , kind]) => {
    if (kind === "object") return score < 100 ? score : /_|--/.test(title.split(".").pop()) ? 40 : 12;
    if (kind === "index" && page === "glossary") return score / 5;
    const place = PLACES.find(([pattern]) => pattern.test(page));
    return score + (place ? place[1] : 0);
  },
  objNameMatch: 100,
  objPartialMatch: 1,
  objPrio: { 0: 3, 1: 2, 2: 1 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
