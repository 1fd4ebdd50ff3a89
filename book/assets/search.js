// Sphinx fetches a page for the summary of a hit, which browsers refuse in a folder; the texts of all
// pages are in the script before this one.  Only the search page loads the two.
"use strict";
{
  const ask = window.fetch;
  window.fetch = (address, ...rest) =>
    address in window.rcbookTexts
      ? Promise.resolve(new Response(window.rcbookTexts[address]))
      : ask(address, ...rest);
}
