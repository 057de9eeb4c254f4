"""From a hit to its response, in the order of the steps.

===================  ==============================================================================
`hit_simulation`     simulates hits in batches
`look_ahead`         what the simulations show after contact, from which the choice is made
`windows`            the mismatch (window error) of short pieces of motion
`search`             full search (oracle), no reaction (carry on), and labels for training
`prediction`         the classifier: features, file, prediction
`choice`             the result of a choice; `budget` and `chooser` decide who chooses
`alignment`          exit and entry of one reaction
`transition`         servo targets, the blend, and the motion after it
`responder`          all steps for many hits; `response` is the result, `response_settings` the spec
`runtime`            characters at run time, frame by frame
`response_quality`   quality metrics of a response
===================  ==============================================================================

`*_kernel` are compiled inner loops.
"""
