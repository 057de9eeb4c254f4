"""The answer to a hit, in the order in which its parts are used.

=====================================  ===========================================================
`hits`, `look_ahead`                   hits are simulated until a choice can be made
`windows`, `window_config`, `oracle`   the window error, and the exhaustive search by it
`features`, `prediction`               what is told of a hit, and what is predicted from that
`classifier`, `classifier_file`        a trained model, and its file
`alignment`                            when to leave the simulation, and where to enter a reaction
`carry_on`                             how well the base motion fits, to go on with it
`oracle_choice`, `classifier_choice`   who chooses; `budget` says which, `choice` is what comes out
`transition`, `finish`                 servo targets and blend, and the motion after the exit
`respond`, `response`                  hits answered in bulk
`crowd`, `dynamic`, `plan`             characters at run time, frame by frame
`labelling`                            hits as a classifier learns from them
`quality`, `surface`                   how good a response is, and the landscape of its alignment
=====================================  ===========================================================

`*_kernel` are the compiled inner loops of their namesakes.
"""
