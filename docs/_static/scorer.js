/* The search of the guide: words in a title count, and pages that few ask for, and those of one id, come last. */
var LAST = /^(contributing|reference|numerics|stability|equations|extending)$|^reference\//;
var OF_ONE_ID = /^environments\//;
var ASKED = (new URLSearchParams(location.search).get("q") || "").toLowerCase().match(/\w{3,}/g) || [];
var Scorer = {
  score: (result) =>
    result[4] +
    ASKED.filter((word) => result[1].toLowerCase().includes(word)).length -
    (LAST.test(result[0]) ? 20 : OF_ONE_ID.test(result[0]) ? 8 : 0),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
